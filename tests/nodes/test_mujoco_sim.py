"""The plant node alone, and with stand-ins for all nodes that it waits for."""

import json
import socket

from free_port import free_port

from uam_msgs_py.messages import topics
from uam_msgs_py.node import wiring
from uam_sim_bridge.nodes.plant_options import NOT_READY

MODULE = "uam_sim_bridge.nodes.mujoco_sim"


def options(**values):
    arguments = ["--ros-args", "-p", f"hil_port:={free_port()}"]
    for name, value in values.items():
        arguments += ["-p", f"{name}:={value}"]
    return arguments


def publishers(probe, topic):
    return {info.node_name for info in probe.node.get_publishers_info_by_topic(topic.name)}


def test_alone_it_names_missing_nodes_and_stops_cleanly(start):
    running = start(MODULE, *options())
    running.until_logged("waiting for state_estimator to listen to /imu/data")
    assert running.interrupt(times=3) == 0
    assert "Traceback" not in running.output


def test_a_bounded_start_names_missing_nodes(start, tmp_path):
    statistics = tmp_path / "plant.json"
    running = start(MODULE, *options(start_timeout=1.0, statistics=statistics))
    assert running.process.wait(60) == NOT_READY
    assert "no progress for 1 s, waiting for state_estimator" in running.output
    report = json.loads(statistics.read_text())
    assert report["ticks"] == 0 and "no progress" in report["ended_by"]


def test_wrong_parameters_are_refused_in_one_line(start):
    for arguments, message in (
        (options(clock="sundial"), "clock: 'sundial' is not one of lockstep, realtime"),
        (options(vehicle="glider"), "unknown vehicle 'glider'; there are: hexa_arm, s500_arm"),
        (options(plant="bullet"), "unknown plant 'bullet'; there are: mujoco, or a class as"),
        (options(gravity="9.81"), "gravity: unknown"),
        (options(faults="'{}'"), 'faults: {"seed": N, "faults": [...]} expected, as JSON'),
    ):
        running = start(MODULE, *arguments)
        assert running.process.wait(60) == 2
        assert message in running.output and running.output.count("\n") == 1, running.output


def test_a_port_in_use_is_refused_in_one_line(start):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        running = start(MODULE, "--ros-args", "-p", f"hil_port:={port}")
        assert running.process.wait(60) == 2
    assert f"TCP port {port} for the autopilot" in running.output
    assert running.output.count("\n") == 1


def test_its_topics_are_those_of_the_contract(start, probe):
    running = start(MODULE, *options())
    running.until_logged("waiting for")
    for topic in (topics.IMU, topics.JOINTS, topics.MOCAP, topics.TRUTH_STATE):
        probe.until(lambda topic=topic: "mujoco_sim" in publishers(probe, topic), topic.name)
        (info,) = probe.node.get_publishers_info_by_topic(topic.name)
        assert info.qos_profile.reliability == topic.qos.reliability
    assert running.interrupt() == 0


def test_the_list_of_wires_is_that_of_the_running_nodes(start, probe, tmp_path):
    """With all nodes idle, their publishers and subscriptions equal those of `wiring`."""
    modules = [
        "uam_control.nodes." + name
        for name in (
            "state_estimator",
            "mission",
            "position_controller",
            "attitude_controller",
            "arm_controller",
        )
    ]
    nodes = [start(module) for module in modules]
    ports = ["--ros-args", "-p", f"local_port:={free_port()}"]
    nodes += [start(MODULE, *options()), start("uam_sim_bridge.nodes.mavlink_bridge", *ports)]
    file = ["--ros-args", "-p", f"file:={tmp_path / 'log.mcap'}"]
    nodes.append(start("uam_lab.records.recorder", *file))
    probe.until(lambda: wiring.missing(probe.node, recorded=True) == [], "all are there")
    for wire in wiring.WIRES:
        found = probe.node.get_subscriptions_info_by_topic(wire.topic.name)
        listeners = {info.node_name for info in found} - {"recorder"}
        assert listeners == set(wire.subscribers), wire.topic.name
        assert publishers(probe, wire.topic) == {wire.publisher}, wire.topic.name
    for node in nodes:
        assert node.interrupt() == 0, node.output
