"""Every parameter of every node is described, ranged, and refused with a reason."""

import math

import pytest
from free_port import free_port
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters

from uam_lab.flights.ros.node_arguments import FUSED, MODULES
from uam_msgs_py.node import wiring
from uam_sim_bridge.nodes import bridge_parameters

# declared by rclpy itself
RCLPY = ("use_sim_time", "start_type_description_service", "qos_overrides.")
# parameters that count something or name a number of the operating system
WHOLE = {
    wiring.BRIDGE: {
        "local_port",
        "autopilot_port",
        "autopilot_system",
        "signing_link_id",
        "attempts",
        "recovery_attempts",
        "magnet_output",
    },
    wiring.PLANT: {"seed", "hil_port"},
    wiring.MISSION: {"grasp_attempts"},
    wiring.COCKPIT: {"port"},
}
EVERY_NODE = {"fifo_priority", "nice", "tick_times_kept"}


def arguments(node, folder):
    """Arguments by which several of these nodes run beside other programs."""
    own = {
        wiring.BRIDGE: {"local_port": free_port()},
        wiring.PLANT: {"hil_port": free_port()},
        wiring.RECORDER: {"file": folder / "log.mcap"},
        wiring.COCKPIT: {"port": 0},
        wiring.FLIGHT_CONTROLLER: {f"{wiring.BRIDGE}:local_port": free_port()},
    }.get(node, {})
    return ["--ros-args", *(w for name, value in own.items() for w in ("-p", f"{name}:={value}"))]


def described(probe, node):
    """name → (descriptor, value) of the node's own parameters."""
    listed = probe.call(ListParameters, f"/{node}/list_parameters", ListParameters.Request())
    names = [name for name in listed.result.names if not name.startswith(RCLPY)]
    about = probe.call(
        DescribeParameters,
        f"/{node}/describe_parameters",
        DescribeParameters.Request(names=names),
    )
    values = probe.call(
        GetParameters, f"/{node}/get_parameters", GetParameters.Request(names=names)
    )
    pairs = zip(about.descriptors, values.values, strict=True)
    return dict(zip(names, pairs, strict=True))


EVERY = {**MODULES, wiring.FLIGHT_CONTROLLER: FUSED}


@pytest.mark.parametrize("node", EVERY)
def test_every_parameter_is_described_and_ranged(start, probe, tmp_path, node):
    running = start(EVERY[node], *arguments(node, tmp_path))
    found = described(probe, node)
    assert found
    for name, (about, value) in found.items():
        assert about.description and about.additional_constraints, name
        number = value.type in (ParameterType.PARAMETER_INTEGER, ParameterType.PARAMETER_DOUBLE)
        if name in WHOLE.get(node, set()) | EVERY_NODE:
            (allowed,) = about.integer_range
            assert value.type == ParameterType.PARAMETER_INTEGER, name
            assert allowed.from_value <= value.integer_value <= allowed.to_value, name
            assert allowed.step == 1 and allowed.to_value > allowed.from_value, name
            assert f"{allowed.from_value} to {allowed.to_value}" in about.additional_constraints
        elif number:
            (allowed,) = about.floating_point_range
            assert value.type == ParameterType.PARAMETER_DOUBLE, name
            assert allowed.from_value <= value.double_value <= allowed.to_value, name
            for end in (allowed.from_value, allowed.to_value):
                assert math.isfinite(end) and (end == 0.0 or abs(end) >= 1e-9), name
            assert allowed.to_value > allowed.from_value, name
            shown = f"{allowed.from_value:g} to {allowed.to_value:g}"
            assert about.additional_constraints.startswith(shown), name
            assert about.description.endswith("]"), f"{name}: without a unit"
    assert WHOLE.get(node, set()) <= set(found)
    if node == wiring.BRIDGE:  # the direct engine refuses a name that is not among them
        assert set(found) == bridge_parameters.NAMES - {"use_sim_time"}
    assert running.interrupt() == 0, running.output


REFUSED = [
    (wiring.PLANT, "seed:=1.5", "seed: 1.5 is no integer; allowed: 0 to 2147483647"),
    (wiring.PLANT, "hil_port:=70000", "hil_port: 70000 is outside 1 to 65535"),
    (wiring.PLANT, "payload_mass:=-1.0", "payload_mass: -1.0 is outside 0 to 5 kg"),
    (wiring.PLANT, "clock:=sundial", "clock: 'sundial' is not one of lockstep, realtime"),
    (wiring.PLANT, "foreign:=5", "foreign: 5 is no text; allowed: NODE=NAME with commas"),
    (wiring.PLANT, "arm_start:=[0.1]", "arm_start: a list of 2 numbers expected"),
    (wiring.BRIDGE, "local_port:=0", "local_port: 0 is outside 1 to 65535"),
    (wiring.BRIDGE, "autopilot_system:=true", "autopilot_system: True is no integer"),
    (wiring.BRIDGE, "gcs:=7", "gcs: 7 is no text; allowed: udp:HOST:PORT"),
    (wiring.RECORDER, "poll_period:=0.0", "poll_period: 0.0 is outside 0.001 to 1 s"),
    (wiring.RECORDER, "simulated:=1", "simulated: 1 is not true or false"),
    (wiring.RECORDER, "facts:=/no/file", "facts: /no/file cannot be read"),
    (wiring.SCENE, "frame_rate:=1000.0", "frame_rate: 1000.0 is outside 1 to 60 Hz"),
    (wiring.SCENE, "scenario:=3", "scenario: 3 is no text; allowed: name of a file in config"),
    (wiring.MISSION, "vehicle:=3", "vehicle: 3 is no text; allowed: name of a file in config"),
    (wiring.COCKPIT, "port:=-1", "port: -1 is outside 0 to 65535"),
    (wiring.FLIGHT_CONTROLLER, "flight_controller:inner_rate:=-1.0", "inner_rate: -1.0 is outside"),
]


@pytest.mark.parametrize("node, setting, reason", REFUSED)
def test_a_bad_value_is_refused_in_one_line(start, tmp_path, monkeypatch, node, setting, reason):
    monkeypatch.chdir(tmp_path)  # nothing is recorded
    running = start(EVERY[node], "--ros-args", "-p", setting)
    assert running.process.wait(60) == 2
    assert reason in running.output and running.output.count("\n") == 1, running.output
    assert not list(tmp_path.rglob("*.mcap"))
