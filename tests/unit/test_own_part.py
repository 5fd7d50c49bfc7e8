"""The log of a vehicle in a namespace has its own part of the shared topics."""

import numpy as np
import pytest

pytest.importorskip("rclpy")

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log
from rclpy.serialization import deserialize_message, serialize_message

from uam_lab.records.recording.topic_recorder import own_part
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.status import OK, diagnostic
from uam_msgs_py.messages.tf_message import Transform, read_transforms, transforms_message

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def frames(*pairs):
    return transforms_message([Transform(7, *pair, np.ones(3), LEVEL) for pair in pairs])


def statuses(*names):
    message = DiagnosticArray()
    for name in names:
        message.status += diagnostic(7, name, OK, "running", {}).status
    return serialize_message(message)


def line(logger):
    return serialize_message(Log(name=logger, msg="said"))


OWN = [
    (topics.TF, frames(("world", "uav1/base_link"), ("uav1/base_link", "uav1/link_1"))),
    (topics.TF_STATIC, frames(("uav1/base_link", "uav1/shoulder"))),
    (topics.DIAGNOSTICS, statuses("uav1/mission")),
    (topics.ROSOUT, line("uav1.mission")),
    (topics.ROSOUT, line("uav1.mission.rclpy")),
]
OTHERS = [
    (topics.TF, frames(("world", "uav2/base_link"), ("world", "base_link"))),
    (topics.TF_STATIC, frames(("uav11/base_link", "uav11/shoulder"))),
    (topics.DIAGNOSTICS, statuses("uav2/mission", "uav11/mission", "mission")),
    (topics.ROSOUT, line("uav2.mission")),
    (topics.ROSOUT, line("uav11.mission")),
    (topics.ROSOUT, line("rviz")),
]


@pytest.mark.parametrize("topic, data", OWN, ids=range(len(OWN)))
def test_its_own_messages_are_kept_as_they_are(topic, data):
    assert own_part(topic, "/uav1")(data) is data


@pytest.mark.parametrize("topic, data", OTHERS, ids=range(len(OTHERS)))
def test_those_of_others_are_left_out(topic, data):
    assert own_part(topic, "/uav1")(data) is None


def test_of_a_mixed_message_its_own_part_is_kept():
    mixed = frames(("world", "uav2/base_link"), ("world", "uav1/base_link"))
    kept = read_transforms(own_part(topics.TF, "/uav1")(mixed))
    assert [(one.stamp, one.parent, one.child) for one in kept] == [(7, "world", "uav1/base_link")]
    mixed = own_part(topics.DIAGNOSTICS, "/uav1")(statuses("uav2/mission", "uav1/mission"))
    assert [s.name for s in deserialize_message(mixed, DiagnosticArray).status] == ["uav1/mission"]


def test_without_a_namespace_and_on_other_topics_everything_is_kept():
    assert all(own_part(topic, "/") is None for topic in topics.ALL)
    shared = {topics.TF, topics.TF_STATIC, topics.DIAGNOSTICS, topics.ROSOUT}
    assert {topic for topic in topics.ALL if own_part(topic, "/uav1")} == shared
