"""A running controller node: adaptation services, parameter check, whole profiles, dumps."""

import numpy as np
import pytest
import rclpy
import yaml
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.parameter import Parameter, parameter_value_to_python
from std_srvs.srv import SetBool, Trigger

from uam_control.coordinates import coordinates
from uam_control.profiles.profile import NODES, load_profile, parameter_set
from uam_control.settings import configuration
from uam_lab.flights.processes.guest import Guest
from uam_lab.flights.ros.profile_switch import ProfileSwitch, SwitchRefused
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import ReferenceWriter
from uam_msgs_py.messages.convert import TrajectoryWriter, read_joints
from uam_msgs_py.messages.flight_events import ParameterChange
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.node.tunable import TunableNode

COORDINATES = coordinates(2)
PERIOD, ADAPTATION_PERIOD = 4_000_000, 20_000_000  # [ns]
POSITION = "position_controller"
GAINS = ["K0", "K1", "K2", "K3", "zeta"]


def parameters(values):
    return [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]


def set_atomically(probe, node, service="set_parameters_atomically", **values):
    request = SetParametersAtomically.Request(parameters=parameters(values))
    return probe.call(SetParametersAtomically, f"/{node}/{service}", request).result


def get(probe, node, *names):
    request = GetParameters.Request(names=list(names))
    values = probe.call(GetParameters, f"/{node}/get_parameters", request).values
    return [parameter_value_to_python(value) for value in values]


def list_names(probe, node):
    found = probe.call(ListParameters, f"/{node}/list_parameters", ListParameters.Request())
    return sorted(found.result.names)


def changes_of(probe):
    """Return a list of the received parameter changes with their stamps."""
    found = []
    topic = topics.CHANGES
    probe.node.create_subscription(
        topic.type, topic.name, lambda m: found.append(ParameterChange.from_message(m)), topic.qos
    )
    return found


class Flying:
    """The position controller with inputs of the test: errors of 0.1 m and 0.2 m/s."""

    def __init__(self, start, probe):
        self.probe = probe
        self.node = start(f"uam_control.nodes.{POSITION}")
        self.state = probe.publisher(topics.STATE)
        self.reference = probe.publisher(topics.REFERENCE)
        self.commands = probe.collect(topics.POSITION_COMMAND)
        self.gains = probe.collect(topics.POSITION_ADAPTATION)
        self.changes = changes_of(probe)
        self.stamp = 0
        self._state, self._reference = TrajectoryWriter(COORDINATES), ReferenceWriter(2)
        probe.until_connected(
            POSITION,
            [self.state, self.reference],
            [topics.POSITION_COMMAND, topics.POSITION_ADAPTATION],
        )

    def tick(self, count=5):
        """Run `count` ticks (at least 5 at first); return the newest gains by name."""
        chi = np.zeros((3, 8))
        chi[0, 0], chi[1, 0] = 0.1, 0.2
        for _ in range(count):
            self.stamp += PERIOD
            before = len(self.commands)
            desired = self._reference.fill(self.stamp, np.zeros((3, 8)), True, self.stamp)
            self.reference.publish(desired)
            self.state.publish(self._state.fill(self.stamp, chi))
            self.probe.until(lambda n=before: len(self.commands) > n, "a command")
        due = self.stamp // ADAPTATION_PERIOD * ADAPTATION_PERIOD
        self.probe.until(lambda: self.gains and stamp_of(self.gains[-1]) >= due, "gains")
        _, position, _ = read_joints(self.gains[-1], GAINS)
        return dict(zip(GAINS, position, strict=True))

    def call(self, kind, name, request):
        return self.probe.call(kind, f"/{POSITION}/{name}", request)


@pytest.fixture
def flying(start, probe):
    return Flying(start, probe)


def test_the_adaptation_can_be_frozen_freed_and_reset(flying, probe):
    flying.tick(60)
    initial = load_profile("s500").sets[POSITION].k_initial[0]
    assert flying.tick()["K0"] != initial
    answer = flying.call(SetBool, "freeze_adaptation", SetBool.Request(data=True))
    assert answer.success and answer.message.startswith("adapted gains frozen at: K0 ")
    assert get(probe, POSITION, "adapt") == [False]
    held = flying.tick(10)
    assert flying.tick(10) == held
    answer = flying.call(Trigger, "reset_adaptation", Trigger.Request())
    assert answer.success and f"K0 {initial:g}" in answer.message
    after = flying.tick(10)
    assert after["K0"] == initial
    assert after["zeta"] == load_profile("s500").sets[POSITION].zeta_initial
    flying.call(SetBool, "freeze_adaptation", SetBool.Request(data=False))
    assert get(probe, POSITION, "adapt") == [True]
    assert flying.tick(10)["K0"] != initial
    probe.until(lambda: len(flying.changes) == 3, "three changes")
    (_, frozen), (stamp, reset), (_, freed) = flying.changes
    assert (frozen.by, frozen.values) == ("freeze_adaptation", {"adapt": (True, False)})
    assert reset.by == "reset_adaptation" and reset.values["K0"] == (held["K0"], initial)
    assert 0 < stamp <= flying.stamp and reset.accepted
    assert freed.values == {"adapt": (False, True)}


def test_a_change_acts_from_the_next_tick_and_refused_ones_are_published(flying, probe):
    flying.tick(10)
    assert set_atomically(probe, POSITION, varpi=0.2, lambda_1=[1.0, 1.0, 5.0]).successful
    refused = set_atomically(probe, POSITION, varpi=0.3, lambda_1=[1.0, -1.0, 5.0])
    assert not refused.successful and "lambda_1" in refused.reason
    together = set_atomically(probe, POSITION, thrust_min=40.0)
    assert together.reason == "thrust_min: 40 N is above thrust_max, 36 N"
    for name, value in (("no_such", 1.0), ("varpi", "1"), ("varpi", True), ("law", "asmc1")):
        assert not set_atomically(probe, POSITION, **{name: value}).successful
    assert get(probe, POSITION, "varpi", "thrust_min")[0] == 0.2
    probe.until(lambda: len(flying.changes) == 7, "seven changes")
    stamps, changes = zip(*flying.changes, strict=True)
    assert set(stamps) == {flying.stamp}
    assert [one.accepted for one in changes] == [True] + 6 * [False]
    assert changes[1].values["varpi"] == (0.2, 0.3)
    assert changes[3].values == {"no_such": (None, 1.0)} and changes[3].reason == "no_such: unknown"
    assert changes[4].reason == "varpi: '1' is not numeric; allowed: 1e-09 to 1e+06"
    assert changes[6].reason == "law: read-only, fixed once the node runs"


def test_a_check_changes_and_publishes_nothing(flying, probe):
    flying.tick()
    assert set_atomically(probe, POSITION, "check_parameters", varpi=0.2).successful
    assert not set_atomically(probe, POSITION, "check_parameters", varpi=-0.2).successful
    assert get(probe, POSITION, "varpi") == [load_profile("s500").sets[POSITION].varpi]
    assert flying.changes == []


def test_a_check_does_not_begin_simulated_time(domain):
    rclpy.init()
    try:
        node = TunableNode("checked")
        assert node.check_parameters([Parameter("use_sim_time", value=True)]).successful
        assert not node.get_clock().ros_time_is_active
        node.destroy_node()
    finally:
        rclpy.shutdown()


@pytest.mark.parametrize("node", NODES)
def test_every_parameter_of_every_node_has_a_description(start, probe, node):
    start(f"uam_control.nodes.{node}")
    names = [
        n
        for n in list_names(probe, node)
        if "." not in n and n not in ("use_sim_time", "start_type_description_service")
    ]
    request = DescribeParameters.Request(names=names)
    found = probe.call(DescribeParameters, f"/{node}/describe_parameters", request).descriptors
    values = get(probe, node, *names)
    for name, text, value in zip(names, found, values, strict=True):
        assert text.description, name
        if isinstance(value, bool | str | int):  # an integer may have no unit
            continue
        assert text.description.endswith("]") and " to " in text.additional_constraints, name
        axes = parameter_set(node, {})[1]
        if name in ("inertia", "lambda_1", "torque_max"):
            assert text.additional_constraints.endswith("; " + ", ".join(axes)), name


def dump(probe, nodes):
    """Return the output of `ros2 param dump` for each node."""
    text = ""
    for node in nodes:
        names = list_names(probe, node)
        content = {}
        for name, value in zip(names, get(probe, node, *names), strict=True):
            *folders, last = name.split(".")
            place = content
            for folder in folders:
                place = place.setdefault(folder, {})
            place[last] = value.tolist() if hasattr(value, "tolist") else value
        body = {f"/{node}": {"ros__parameters": content}}
        text += yaml.dump(body, default_flow_style=False)
    return text


@pytest.mark.parametrize("name", ["s500", "asmc2"])
def test_a_dump_of_the_running_nodes_is_their_profile(start, probe, tmp_path, name):
    profile = configuration.path(f"profiles/{name}.yaml")
    for node in NODES:
        start(f"uam_control.nodes.{node}", "--ros-args", "--params-file", str(profile))
    changed = load_profile(name).sets["arm_controller"].inertia[0] * 1.5
    requested = {"inertia": [changed, 0.02], "freeze_when_saturated": False}
    request = SetParameters.Request(parameters=parameters(requested))
    results = probe.call(SetParameters, "/arm_controller/set_parameters", request).results
    assert all(result.successful for result in results)
    file = tmp_path / "dump.yaml"
    file.write_text(dump(probe, NODES))
    assert "use_sim_time" in file.read_text() and "control_period" in file.read_text()
    found = load_profile(str(file))
    before = load_profile(name)
    for node in NODES:
        if node != "arm_controller":
            assert found.sets[node] == before.sets[node]
    assert found.sets["arm_controller"].inertia == (changed, 0.02)
    assert found.sets["arm_controller"].freeze_when_saturated is False


@pytest.fixture
def switch():
    """A profile switch with its own node, as in `uam profile`."""
    with Guest("switch", {}) as guest:
        yield ProfileSwitch(guest.node)


def test_a_profile_is_accepted_by_all_nodes_or_by_none(start, probe, switch, tmp_path):
    for node in NODES:
        start(f"uam_control.nodes.{node}")
    for node in NODES:  # `switch` waits less for starting nodes
        list_names(probe, node)
    changes = changes_of(probe)
    assert switch.switch(load_profile("s500")) == {}
    file = tmp_path / "mine.yaml"
    file.write_text(
        "arm_controller: {ros__parameters: {varpi: 0.9, nu: [1.0, 2.0, 3.0, 4.0]}}\n"
        "position_controller: {ros__parameters: {thrust_max: 30.0}}\n"
    )
    changed = switch.switch(load_profile("s500", str(file)))
    assert changed["position_controller"] == {"thrust_max": (36.0, 30.0)}
    assert changed["mission"] == {"reference_thrust": (36.0, 30.0)}  # follows thrust_max
    assert set(changed["arm_controller"]) == {"varpi", "nu"}
    assert get(probe, "arm_controller", "varpi") == [0.9]
    # a request whose answer comes late is sent again: a node may report its change twice
    told = {POSITION, "mission", "arm_controller"}
    probe.until(lambda: {change.node for _, change in changes} == told, "the three changes")
    with pytest.raises(SwitchRefused, match="active law modular cannot change to asmc1 in flight"):
        switch.switch(load_profile("asmc1"))

    # one node refuses a value by its own check
    wrong = load_profile("s500")
    object.__setattr__(wrong.sets["mission"], "tilt_failsafe", 9.0)
    with pytest.raises(SwitchRefused, match="^mission: tilt_failsafe: 9.0 is outside"):
        switch.switch(wrong)
    assert get(probe, "arm_controller", "varpi") == [0.9]
    assert get(probe, POSITION, "thrust_max") == [30.0]
