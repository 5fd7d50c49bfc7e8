"""The tick of all control nodes in one process, with nodes that note what they do."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy")

from control_rig import LEVEL, LOW, PERIOD, REST, WEIGHT, Rig
from sensor_msgs.msg import JointState

from uam_control.coordinates import coordinates
from uam_control.stamps import SECOND
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import (
    ImuWriter,
    JointStateWriter,
    PoseWriter,
    TrajectoryWriter,
    read_pose,
)
from uam_msgs_py.messages.layouts import BadMessage, stamp_of
from uam_msgs_py.messages.serialized import Template
from uam_msgs_py.node import wiring
from uam_msgs_py.node.rightful import RightfulNodes
from uam_msgs_py.node.tick_times import NoTickTimes
from uam_sim_bridge.nodes.fused_tick import FusedTick, Thinned, is_whole

STATE = TrajectoryWriter(coordinates(2))


class End:
    """A publisher or a subscription."""

    def __init__(self, topic_name):
        self.topic_name, self.sent = topic_name, []

    def publish(self, message):
        self.sent.append(message)


class FakeNode:
    """A node with its topics of WIRES; it notes its ticks and what it is told to publish."""

    def __init__(self, name, log, publishers="", remapped=()):
        self.name, self.log, self.remapped = name, log, dict(remapped)
        self.times, self.stamp, self.handles = NoTickTimes(), 0, {}
        self.rightful = RightfulNodes("/", publishers)
        self.outlets = self._ends(lambda wire: wire.publisher == name)
        self.inlets = self._ends(lambda wire: name in wire.subscribers)
        self.errors, self.vehicle, self.poses = self, self, self
        self.topic, self.read = topics.MOCAP, read_pose  # of the poses

    def reads_odometry(self):
        self.topic, self.read = topics.ODOMETRY_IN, lambda message: message
        if topics.MOCAP.name in self.inlets:
            self.inlets[self.topic.name] = End(f"/{self.topic.name}")
            del self.inlets[topics.MOCAP.name]
        return self

    def _ends(self, has):
        names = [wire.topic.name for wire in wiring.WIRES if has(wire)]
        return {one: End(self.resolve_topic_name(one)) for one in names}

    def get_name(self):
        return self.name

    def get_namespace(self):
        return "/"

    def resolve_topic_name(self, name):
        return f"/{self.remapped.get(name, name)}"

    def handle_by(self, topic, handle):
        self.handles[topic] = handle

    def done_tick(self, stamp, begun):
        self.stamp = stamp
        self.log.append((self.name, "done", stamp))

    def estimated(self, take):
        return take()

    def begin_tick(self, stamp):
        self.log.append((self.name, "link", stamp))
        return 0.0

    def take_waiting(self, subscription):
        self.log.append((self.name, "takes", subscription.topic_name))

    def tell(self, stamp, state):
        self.log.append((self.name, "status", stamp))

    def answer(self, *given):
        self.log.append((self.name, "answer", *given[:1]))

    def send(self, *given):
        self.log.append((self.name, "send", *given[:1]))

    def note_pose(self, stamp):
        """Of the estimator, as the next one."""

    def begin_anew_before(self, stamp):
        """See `note_pose`."""

    def note_time(self, stamp):
        """Of the mission, as the next one."""

    def note_desired(self, stamp, attitude):
        """See `note_time`."""

    def note_mission(self, stamp, time, phase):
        """Of the bridge."""


def nodes(log=None, **publishers):
    """The nodes of a process by their names; publishers: parameter of each."""
    log = [] if log is None else log
    return {name: FakeNode(name, log, publishers.get(name, "")) for name in wiring.FUSED}


class Process:
    """A fused tick on the stages of a control tick, and what is published to it."""

    def __init__(self, change=lambda node: None):
        """change: is called with each node before they join."""
        self.log, rig = [], Rig()
        control, self.angles = rig.control, rig.angles
        self.port, every = rig.port, nodes(self.log)
        stages = control.estimator, control.mission, *control.laws.values(), control.bridge
        for node, stage in zip(every.values(), stages, strict=True):
            node.stage, node.joint_names = stage, ("alpha_1", "alpha_2")
            change(node)
        every[wiring.ARM].hand = control.hand
        self.every, own = every, FakeNode(wiring.FLIGHT_CONTROLLER, self.log)
        self.fused = FusedTick(own, every)
        self.stage, self.stamp = control.estimator, 0
        self.writers = PoseWriter(), JointStateWriter(["alpha_1", "alpha_2"]), ImuWriter()

    def hear(self, topic, message):
        self.every[wiring.ESTIMATOR].handles[topic](message)

    def sense(self):
        """Give the samples of a tick to the process."""
        pose, joints, imu = self.writers
        joints.position[:], stamp = self.angles, self.stamp
        moved = LOW + 1e-6 * stamp / PERIOD
        self.hear(topics.MOCAP, pose.fill(stamp, moved, LEVEL))
        self.hear(topics.JOINTS, joints.stamped(stamp))
        self.hear(topics.IMU, imu.fill(stamp, REST, WEIGHT))
        self.stamp += PERIOD


def test_what_others_wait_for_is_published_after_the_setpoint_the_rest_last():
    process = Process()
    process.sense()
    assert process.log == []
    process.fused.settle()
    process.fused.settle()  # without a sample there is no tick
    e, m, p, a, r, b = wiring.FUSED
    sensors = [(e, "takes", "/vrpn_mocap/uam/pose"), (e, "takes", "/joint_states")]
    assert process.log == [
        *(*sensors, (m, "takes", "/vrpn_mocap/payload/pose")),
        *((e, "done", 0), (m, "status", 0)),
        *((p, "done", 0), (a, "done", 0), (r, "done", 0)),
        *((b, "link", 0), (b, "done", 0)),
        *((m, "answer"), (p, "answer"), (a, "answer"), (r, "answer"), (b, "answer", 0)),
        *((m, "done", 0), (e, "send", 0), (m, "send")),
        *((p, "send", 0), (a, "send", 0), (r, "send", 0), (b, "send", 0)),
        (wiring.FLIGHT_CONTROLLER, "done", 0),
    ]


@pytest.mark.parametrize("waiting, answered", [(1, [0]), (3, [0, 1, 2]), (4, [3]), (6, [5])])
def test_up_to_three_samples_are_worked_off_of_more_the_newest(waiting, answered):
    process = Process()
    for _ in range(waiting):
        process.sense()
    process.fused.settle()
    stamps = [one[2] for one in process.log if one[:2] == (wiring.BRIDGE, "done")]
    assert stamps == [PERIOD * tick for tick in answered]
    assert process.fused.dropped == waiting - len(answered)
    assert process.stage.stamp == PERIOD * (waiting - 1)


def test_the_angles_of_joints_without_usable_efforts_count():
    process = Process()
    process.hear(topics.MOCAP, process.writers[0].fill(0, LOW, LEVEL))
    two = [0.0, 0.0]
    given = JointState(name=["alpha_1", "alpha_2"], position=two, velocity=two, effort=[1.0])
    with pytest.raises(BadMessage, match="1 effort, 2 expected"):
        process.hear(topics.JOINTS, Template(given).stamped(0))
    process.hear(topics.IMU, process.writers[2].fill(0, REST, WEIGHT))
    process.fused.settle()
    assert (wiring.BRIDGE, "done", 0) in process.log


def test_a_topic_between_the_nodes_is_heard_but_not_used():
    every = Process().every
    for wire in wiring.WIRES:
        if wire.publisher in every and wire.topic is not topics.AUTOPILOT_BATTERY:
            for name in set(wire.subscribers) & every.keys():
                assert every[name].handles[wire.topic](b"no message") is None, wire.topic
    assert topics.AUTOPILOT_BATTERY not in every[wiring.MISSION].handles


def test_a_process_is_whole_with_all_nodes_that_read_each_other():
    assert is_whole(nodes())
    for absent in wiring.FUSED:
        assert not is_whole({name: one for name, one in nodes().items() if name != absent})
    assert not is_whole(nodes(arm_controller="mission=my_planner"))
    assert not is_whole(nodes(mission="vrpn_mocap/uam/pose=tracker"))
    assert is_whole(nodes(**dict.fromkeys(wiring.FUSED, "vrpn_mocap/uam/pose=tracker")))
    changed = nodes()
    changed[wiring.ARM] = FakeNode(wiring.ARM, [], remapped=[(topics.STATE.name, "mine")])
    assert not is_whole(changed)
    odometry = {name: node.reads_odometry() for name, node in nodes().items()}
    assert is_whole(odometry)
    assert not is_whole(odometry | {wiring.BRIDGE: nodes()[wiring.BRIDGE]})


def test_the_poses_are_those_that_the_estimator_reads():
    process = Process(lambda node: node.reads_odometry())
    read = []
    process.every[wiring.ESTIMATOR].note_pose = read.append
    process.hear(topics.ODOMETRY_IN, (7, LOW, LEVEL))
    assert read == [7] and topics.MOCAP not in process.every[wiring.ESTIMATOR].handles
    assert process.every[wiring.BRIDGE].handles[topics.ODOMETRY_IN](b"not read again") is None


@given(rate=st.floats(1.0, 1000.0), steps=st.lists(st.integers(1, 20), min_size=1, max_size=60))
def test_a_thinned_topic_has_the_first_message_of_each_period(rate, steps):
    sent, period, first = [], round(SECOND / rate), {}
    thinned = Thinned(sent.append)
    thinned.period = period
    for total in np.cumsum(steps).tolist():
        thinned(STATE.stamped(total * PERIOD))
        first.setdefault(total * PERIOD // period, total * PERIOD)
    assert [stamp_of(one) for one in sent] == list(first.values())


def test_only_topics_of_the_process_are_thinned():
    process = Process()
    state = process.every[wiring.ESTIMATOR].outlets[topics.STATE.name]
    setpoint = process.every[wiring.BRIDGE].outlets[topics.SETPOINT.name]
    for rate in (50.0, 0.0):
        process.fused.thin(rate)
        for tick in range(1, 11):  # two periods of 20 ms
            state.publish(STATE.stamped(tick * PERIOD))
            setpoint.publish(STATE.stamped(tick * PERIOD))
    assert len(state.sent) == 3 + 10 and len(setpoint.sent) == 20
