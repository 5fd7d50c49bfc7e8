"""Delivery within a process: who gets a message, when it is sent, how often."""

from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy")

from rclpy.qos import QoSProfile
from std_msgs.msg import Bool

from uam_control.coordinates import coordinates
from uam_control.settings.parameter_set import ParameterError
from uam_control.stamps import SECOND
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.messages.serialized import stays_serialized
from uam_msgs_py.messages.trajectories import TrajectoryWriter
from uam_msgs_py.node import door, local_delivery, wiring
from uam_msgs_py.node.door import Door
from uam_msgs_py.node.local_delivery import LocalDelivery
from uam_msgs_py.node.rightful import RightfulNodes

TICK = 4_000_000  # [ns]
STATE = TrajectoryWriter(coordinates(2))


@dataclass(eq=False)
class FakePublisher:
    topic_name: str
    sent: list = field(default_factory=list)
    there: int = 0  # connected subscriptions of other processes

    def publish(self, message):
        self.sent.append(message)

    def get_subscription_count(self):
        return self.there


@dataclass(eq=False)
class FakeSubscription:
    topic_name: str
    msg_type: type
    callback: object
    matched: int = 0
    raw: bool = True
    arrived: list = field(default_factory=list)

    def take_message(self):
        return (self.arrived.pop(0), {}) if self.arrived else None

    def get_publisher_count(self):
        return self.matched


class FakeNode:
    def __init__(self, delivery, name, publishers="", triggers=()):
        self.delivery, self.name, self.triggers = delivery, name, triggers
        self.rightful = RightfulNodes("/", publishers)
        self.door = Door(self)

    def get_name(self):
        return self.name

    def get_namespace(self):
        return "/"

    def resolve_topic_name(self, name):
        return f"/{name.removeprefix('/')}"

    def publisher(self, topic):
        made = FakePublisher(self.resolve_topic_name(topic.name))
        return self.delivery.outlet(self, topic, made)

    def listen(self, topic, callback=None):
        heard = []
        made = FakeSubscription(
            self.resolve_topic_name(topic.name),
            topic.type,
            callback or heard.append,
            raw=stays_serialized(topic.type),
        )
        self.delivery.note(self, topic.name, made)
        return made, heard


@pytest.fixture(autouse=True)
def no_middleware(monkeypatch):
    monkeypatch.setattr(local_delivery, "LocalPublisher", lambda node, *_: f"guard of {node.name}")
    monkeypatch.setattr(local_delivery, "identity", lambda publisher: b"")
    monkeypatch.setattr(door, "Taker", lambda subscription: subscription)


def nodes(delivery, *names):
    return [FakeNode(delivery, name) for name in names]


def test_readers_get_the_object_at_once_others_when_it_is_sent():
    delivery = LocalDelivery()
    estimator, mission, arm = nodes(delivery, wiring.ESTIMATOR, wiring.MISSION, wiring.ARM)
    out = estimator.publisher(topics.STATE)
    (first, heard), (second, also) = mission.listen(topics.STATE), arm.listen(topics.STATE)
    delivery.connect([estimator, mission, arm])
    message = STATE.stamped(TICK)
    out.publish(message)
    assert heard[0] is message and also[0] is message
    assert out.publisher.sent == []
    delivery.send()
    assert out.publisher.sent == [message]
    delivery.send()
    assert len(out.publisher.sent) == 1
    assert mission.door.guards == {first: "guard of mission"}
    assert not delivery.inlets and delivery.known == {first, second}


def test_answers_are_sent_before_the_rest_and_in_order():
    """The plant needs status, magnet and setpoint, nobody else the reference."""
    delivery, log = LocalDelivery(), []
    every = nodes(delivery, *wiring.FUSED)
    _, mission, *_, bridge = every
    chosen = (topics.REFERENCE, topics.MISSION_STATUS, topics.MAGNET)
    outlets = {topic: mission.publisher(topic) for topic in chosen}
    outlets[topics.SETPOINT] = bridge.publisher(topics.SETPOINT)
    for node in every:
        node.listen(topics.REFERENCE)
    delivery.connect(every)
    for topic, outlet in outlets.items():
        outlet.publisher.publish = lambda message, topic=topic: log.append(topic)
        outlet.publish(STATE.stamped(TICK))
    assert log == []
    delivery.send_answers()
    assert log == [topics.MISSION_STATUS, topics.MAGNET, topics.SETPOINT]
    delivery.send()
    assert log[3:] == [topics.REFERENCE]


def test_without_a_node_its_inputs_are_answers():
    delivery = LocalDelivery()
    every = nodes(delivery, *(name for name in wiring.FUSED if name != wiring.ARM))
    out = every[0].publisher(topics.STATE)
    every[1].listen(topics.STATE)
    for node in every[2:]:
        node.listen(topics.REFERENCE)
    delivery.connect(every)
    out.publish(STATE.stamped(TICK))
    delivery.send_answers()
    assert len(out.publisher.sent) == 1


def test_a_topic_of_another_process_is_taken_once_and_given_to_all():
    delivery = LocalDelivery()
    estimator, mission = nodes(delivery, wiring.ESTIMATOR, wiring.MISSION)
    (first, heard), (second, also) = estimator.listen(topics.JOINTS), mission.listen(topics.JOINTS)
    qos = delivery.reading(mission, topics.JOINTS, QoSProfile(depth=400))
    assert qos.depth == local_delivery.UNREAD_DEPTH
    assert delivery.reading(mission, topics.MOCAP, QoSProfile(depth=400)).depth == 400
    delivery.connect([estimator, mission])
    first.arrived += ["one", "two"]
    second.arrived += ["copy"]
    delivery.take_waiting(second)
    assert heard == also == ["one", "two"]
    assert second.arrived == ["copy"]


def test_a_node_whose_publisher_is_another_one_is_not_served_locally():
    delivery = LocalDelivery()
    mission = FakeNode(delivery, wiring.MISSION)
    arm = FakeNode(delivery, wiring.ARM, publishers="mission=my_planner")
    out = mission.publisher(topics.REFERENCE)
    subscription, heard = arm.listen(topics.REFERENCE)
    delivery.connect([mission, arm])
    out.publish(STATE.stamped(TICK))
    assert heard == [] and delivery.inlets["/uam/reference"].subscription is subscription


def test_readers_of_one_process_agree_on_the_publisher():
    delivery = LocalDelivery()
    for name, publishers in ((wiring.ATTITUDE, ""), (wiring.ARM, "mission=my_planner")):
        FakeNode(delivery, name, publishers).listen(topics.REFERENCE)
    with pytest.raises(ParameterError, match="attitude_controller names /mission, arm_controller"):
        delivery.connect()


def test_a_message_for_a_node_whose_turn_is_over_calls_for_another_pass():
    delivery = LocalDelivery()
    estimator = FakeNode(delivery, wiring.ESTIMATOR, "imu/data=mavlink_bridge", ("imu/data",))
    bridge = FakeNode(delivery, wiring.BRIDGE)
    imu, state = bridge.publisher(topics.IMU), estimator.publisher(topics.STATE)
    estimator.listen(topics.IMU)
    bridge.triggers = (topics.STATE.name,)
    bridge.listen(topics.STATE)
    delivery.connect([estimator, bridge])
    state.publish(STATE.stamped(TICK))
    assert not delivery.again
    imu.publish(b"")
    assert delivery.again


@pytest.mark.parametrize("matched", [True, False])
def test_connected_ends_count_the_readers_in_the_process_once(matched):
    delivery = LocalDelivery()
    estimator, mission = nodes(delivery, wiring.ESTIMATOR, wiring.MISSION)
    out = estimator.publisher(topics.STATE)
    subscription, _ = mission.listen(topics.STATE)
    subscription.matched = int(matched)
    out.publisher.there = 1 + matched  # the recorder, too
    delivery.connect([estimator, mission])
    assert out.get_subscription_count() == 2
    assert subscription.get_publisher_count() + delivery.writers(subscription) == 1


def test_a_message_has_the_form_that_its_reader_takes():
    delivery = LocalDelivery()
    mission, bridge = nodes(delivery, wiring.MISSION, wiring.BRIDGE)
    magnet = mission.publisher(topics.MAGNET)
    subscription, heard = bridge.listen(topics.MAGNET)
    assert not subscription.raw
    delivery.connect([mission, bridge])
    magnet.publish(b"\x00\x01\x00\x00\x01")
    magnet.publish(Bool(data=False))
    assert [message.data for message in heard] == [True, False]


@given(
    rate=st.floats(1.0, 1000.0),
    steps=st.lists(st.integers(1, 20), min_size=1, max_size=60),
)
def test_thinned_topics_send_the_first_message_of_each_period(rate, steps):
    delivery = LocalDelivery()
    every = nodes(delivery, *wiring.FUSED)
    state, magnet = every[0].publisher(topics.STATE), every[1].publisher(topics.MAGNET)
    for node in every:
        _, heard = node.listen(topics.STATE)
    delivery.connect(every)
    delivery.thin(rate)
    stamps = [TICK * sum(steps[: i + 1]) for i in range(len(steps))]
    for stamp in stamps:
        state.publish(STATE.stamped(stamp))
        magnet.publish(b"\x00\x01\x00\x00\x01")
    delivery.send()
    period = round(SECOND / rate)
    first = {}
    for stamp in stamps:
        first.setdefault(stamp // period, stamp)
    assert [stamp_of(one) for one in state.publisher.sent] == list(first.values())
    assert len(heard) == len(magnet.publisher.sent) == len(steps)


def test_without_a_rate_every_message_is_sent():
    delivery = LocalDelivery()
    every = nodes(delivery, *wiring.FUSED)
    out = every[0].publisher(topics.STATE)
    for node in every:
        node.listen(topics.STATE)
    delivery.connect(every)
    delivery.thin(10.0)
    delivery.thin(0.0)
    for tick in range(1, 10):
        out.publish(STATE.stamped(tick * TICK))
    delivery.send()
    assert len(out.publisher.sent) == 9
