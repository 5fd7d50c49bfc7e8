"""Who may publish, over ROS: early impostors, configured names, messages that cannot be used."""

import signal
import time

import numpy as np
import pytest
import rclpy
from rclpy.node import Node
from std_msgs.msg import Bool

from uam_control.coordinates import coordinates
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import read_reference
from uam_msgs_py.messages.convert import PoseWriter, TrajectoryWriter
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.messages.status import ERROR
from uam_msgs_py.node import sole_publisher
from uam_msgs_py.node.door import Door
from uam_msgs_py.node.double import STARTED
from uam_msgs_py.node.rightful import RightfulNodes
from uam_msgs_py.node.wiring import READERS, Connections

PERIOD = 4_000_000
NAMES = coordinates(2)
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
IMPOSTORS = 300  # messages while the node is stopped
MODULE = "uam_control.nodes.mission"


class States:
    """States of a vehicle at rest, published by a node."""

    def __init__(self, node, probe):
        self.node, self.probe, self.stamp = node, probe, 0
        self.out = node.create_publisher(topics.STATE.type, topics.STATE.name, topics.STATE.qos)
        self.writer = TrajectoryWriter(NAMES)

    def send(self, values=None, writer=None, steps=1):
        self.stamp += steps * PERIOD
        state = np.zeros((3, 8)) if values is None else values
        self.out.publish((writer or self.writer).fill(self.stamp, state))

    def until(self, condition, what):
        """Send states until `condition()`."""

        def met():
            self.send()
            return condition()

        self.probe.until(met, what)


@pytest.fixture
def node_named(probe):
    """node_named(name): a further node in the test's process."""
    made = []

    def make(name):
        made.append(Node(name, context=probe.node.context))
        return made[-1]

    yield make
    for node in made:
        node.destroy_node()


class OfMission:
    """A process with a node `mission` that publishes a rare and a frequent topic."""

    def __init__(self):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        node = Node("mission", context=self.context)
        self.rare, self.frequent = (
            node.create_publisher(topic.type, topic.name, topic.qos)
            for topic in (topics.ARMING, topics.REFERENCE)
        )


@pytest.fixture
def missions():
    """Two processes of one node name."""
    made = OfMission(), OfMission()
    yield made
    for one in made:
        one.context.shutdown()


class Guarded:
    """A topic of the mission as another node reads it."""

    def __init__(self, probe, topic):
        self.door = Door(probe.node)
        self.inlet = self.door.listen(topic, topic.reading, True, RightfulNodes(), lambda: True)
        self.guard = self.door.guards[self.inlet]

    def read(self):
        return len(list(self.door.messages(self.inlet)))


class Diagnostics:
    """The newest status of the mission node."""

    def __init__(self, probe):
        self.messages = probe.collect(topics.DIAGNOSTICS)

    def statuses(self):
        return [s for m in self.messages for s in m.status if s.name == "mission"]

    def error(self, *texts):
        """Whether an ERROR contains the texts."""
        wrong = [s.message for s in self.statuses() if s.level == ERROR]
        return any(all(text in message for text in texts) for message in wrong)

    def calm(self):
        """Whether the newest status has no ERROR."""
        newest = self.statuses()[-1:]
        return newest and newest[0].level != ERROR


def test_an_impostor_before_the_rightful_node_is_refused_and_named(start, probe, node_named):
    magnet, diagnostics = probe.collect(topics.MAGNET), Diagnostics(probe)
    mission = start(MODULE, publishers="")
    early = States(probe.node, probe)
    probe.until_connected("mission", [early.out], [topics.MAGNET])
    early.until(
        lambda: diagnostics.error("/uam/state: refused /probe (", "publisher is /state_estimator"),
        "the impostor is named",
    )
    assert magnet == []
    mission.until_logged("/uam/state: refused /probe (")
    rightful = States(node_named("state_estimator"), probe)
    rightful.stamp = early.stamp
    rightful.until(lambda: magnet, "the rightful node is obeyed")
    connections = Connections(probe.node)
    probe.until(lambda: connections.count("mission", READERS, "uam/magnet"), "diagnostics")
    before = len(magnet)
    for _ in range(5):
        early.send()
        rightful.send()
        probe.until(lambda n=before: len(magnet) > n, "an answer")
        before += 1
    assert len(magnet) == before


def test_messages_of_an_impostor_do_not_replace_those_of_the_rightful_node(
    start, probe, node_named
):
    """A starved process reads late: both publishers' messages share its queue."""
    references = probe.collect(topics.REFERENCE)
    mission = start(MODULE, publishers="")
    rightful = States(node_named("state_estimator"), probe)
    impostor = States(probe.node, probe)
    probe.until_connected("mission", [rightful.out, impostor.out], [topics.REFERENCE])
    rightful.until(lambda: references, "the rightful node is obeyed")
    impostor.stamp = rightful.stamp
    mission.process.send_signal(signal.SIGSTOP)
    rightful.send()
    for _ in range(IMPOSTORS):
        impostor.send()
    mission.process.send_signal(signal.SIGCONT)
    # a reference is for the tick after that of its state
    probe.until(lambda: stamp_of(references[-1]) > rightful.stamp, "an answer to the rightful node")
    assert stamp_of(references[-1]) == rightful.stamp + PERIOD


def test_a_second_node_of_the_name_takes_over_rare_topics_only_from_a_silent_process(
    probe, missions
):
    first, second = missions
    rare, frequent = (Guarded(probe, topic) for topic in (topics.ARMING, topics.REFERENCE))
    reference = TrajectoryWriter(NAMES).fill(PERIOD, np.zeros((3, 8)))

    def arrives(guarded, publisher, message):
        def read():
            publisher.publish(message)
            return guarded.read()

        probe.until(read, "a message of the rightful node")

    def second_is_obeyed():
        before = sum(rare.guard.refused.values())
        second.rare.publish(Bool())
        taken = []

        def decided():
            taken.append(rare.read())
            return taken[-1] or sum(rare.guard.refused.values()) > before

        probe.until(decided, "a message of the second node")
        return bool(taken[-1])

    arrives(rare, first.rare, Bool(data=True))
    probe.until(lambda: len(sole_publisher.publishers(probe.node, "/uam/arming")) == 2, "both")
    time.sleep(0.3)  # a killed controller is not waited for that long
    assert not second_is_obeyed()
    sent = 0  # time [ns] of the first one's newest message, or earlier

    def sends_often():
        nonlocal sent
        begun = time.monotonic_ns()
        for _ in range(sole_publisher.MANY):
            sent = time.monotonic_ns()
            arrives(frequent, first.frequent, reference)
        return time.monotonic_ns() - begun < sole_publisher.MANY_WITHIN

    for _ in range(10):
        probe.until(sends_often, "so many messages that they are not rare")
        time.sleep(sole_publisher.LOOK_PERIOD)  # earlier the guard decides without a look
        if not second_is_obeyed():
            break
        # where this test has stalled, the first one was silent: they change places
        assert time.monotonic_ns() - sent > sole_publisher.SILENT
        first, second = second, first
    else:
        pytest.fail("the first one was always silent")
    time.sleep(0.3)
    assert second_is_obeyed()


def test_a_process_of_which_only_rare_messages_are_read_may_be_silent_for_longer():
    life = sole_publisher.Life()
    for k in range(20):
        life.heard(k * 500_000_000)
    assert not life.silent(19 * 500_000_000 + sole_publisher.RARE_SILENT)
    assert life.silent(19 * 500_000_000 + sole_publisher.RARE_SILENT + 1)
    for k in range(sole_publisher.MANY):
        life.heard(60_000_000_000 + k * PERIOD)
    assert life.silent(60_000_000_000 + sole_publisher.MANY * PERIOD + sole_publisher.SILENT)


def test_a_configured_node_is_the_rightful_one(start, probe, node_named):
    magnet = probe.collect(topics.MAGNET)
    mission = start(MODULE, publishers="state_estimator=probe")
    own, usual = States(probe.node, probe), States(node_named("state_estimator"), probe)
    usual.until(lambda: "refused /state_estimator (" in mission.output, "the usual one is refused")
    assert "publisher is /probe" in mission.output and magnet == []
    own.until(lambda: magnet, "the configured one is obeyed")


def test_a_wrong_name_is_refused_at_the_start(start):
    running = start(MODULE, publishers="misson=mine")
    assert running.process.wait(60) == 2
    assert "mission: publishers: 'misson' is none of the nodes " in running.output


def test_unusable_messages_of_the_rightful_node_are_named_and_the_next_good_one_is_used(
    start, probe
):
    magnet, references = probe.collect(topics.MAGNET), probe.collect(topics.REFERENCE)
    diagnostics = Diagnostics(probe)
    start(MODULE, publishers="state_estimator=probe")
    poses = probe.publisher(topics.MOCAP)
    states = States(probe.node, probe)
    probe.until_connected("mission", [states.out, poses], [topics.MAGNET, topics.REFERENCE])

    infinite = np.zeros((3, 8))
    infinite[1, 2] = np.nan
    swapped = TrajectoryWriter([*NAMES[:6], NAMES[7], NAMES[6]])
    unknown = TrajectoryWriter([*NAMES[:7], "elbow"])
    names = coordinates(3)
    further = {"values": np.zeros((3, len(names))), "writer": TrajectoryWriter(names)}
    for bad, reason in (
        ({"values": infinite}, "velocities of z is nan, not finite"),
        ({"writer": swapped}, "expected x, y, z, roll, pitch, yaw, alpha_1, alpha_2"),
        ({"writer": unknown}, "joint names x, y, z, roll, pitch, yaw, alpha_1, elbow"),
        (further, "alpha_3; expected x, y, z, roll, pitch, yaw, alpha_1, alpha_2"),
    ):
        states.send(**bad)
        sender = "/uam/state: refused /probe ("
        probe.until(
            lambda text=reason, start=sender: diagnostics.error(start, text, "publisher is /probe"),
            reason,
        )
        before = len(magnet)
        states.until(lambda n=before: len(magnet) > n, "the next state is used")
    probe.until(diagnostics.calm, "no error that stays")

    # one reference per tick, also after a missing sample; the first tick has one of its own
    probe.until(
        lambda: (
            stamp_of(references[-1]) == states.stamp + PERIOD and len(references) == len(magnet) + 1
        ),
        "both answers to every state",
    )
    for steps in (2, 1, 3):
        before = len(magnet)
        states.send(steps=steps)
        probe.until(lambda n=before: len(magnet) > n, "an answer")
    probe.until(lambda: len(references) > len(magnet), "the last reference")
    assert len(references) == len(magnet) + 1
    assert read_reference(references[-1])[0] == states.stamp + PERIOD

    writer = PoseWriter()

    def other_clock():
        states.send()
        poses.publish(writer.fill(states.stamp + 1_700_000_000 * 10**9, np.zeros(3), LEVEL))
        return diagnostics.error(
            "/vrpn_mocap/uam/pose: refused /probe (",
            "is of another clock than",
            "of uam/state by /probe",
        )

    probe.until(other_clock, "stamps of another clock are named")
    before = len(magnet)
    states.until(lambda n=before: len(magnet) > n, "states are used")


def test_of_two_nodes_of_one_name_the_later_one_ends_and_both_say_so(start, probe):
    said = probe.collect(topics.DIAGNOSTICS)
    options = (MODULE, "--ros-args", "-p", "scenario:=hover")
    start(*options).until_logged("waiting for")
    later = start(*options)
    probe.until(lambda: later.process.poll() is not None, "the later one to end")
    assert later.process.wait(10.0) == 1
    assert later.output.splitlines()[-1].endswith("a node /mission runs already: end it first")
    reports = [status for message in said for status in message.status]
    told = [one for one in reports if one.message == "another node is named /mission"]
    assert len({pair.value for one in told for pair in one.values if pair.key == STARTED}) == 2
