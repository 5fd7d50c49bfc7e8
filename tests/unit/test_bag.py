"""A log is a bag of ROS 2: rosbag2's rules for QoS and metadata, and the public package rosbags."""

import importlib
from pathlib import Path

import pytest
import yaml

pytest.importorskip("rclpy")

from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.serialization import serialize_message
from rosbags.convert.converter import convert
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from uam_lab.records.recording.bag import (
    METADATA,
    BagTopic,
    add_topic,
    new_log_file,
    offered_qos,
    write_metadata,
)
from uam_lab.records.recording.bounded_log import BoundedLog
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.serialized import type_name
from uam_msgs_py.messages.tf_message import Transform, transforms_message

SECOND = 10**9
FOREVER = QosTime(9223372036, 854775807)


def filled(kind):
    """A message in which every sequence has one element.

    rclpy's serialize_message adds undefined bytes after empty sequences of float64; publishers do
    not.
    """
    message = kind()
    for name, field in message.get_fields_and_field_types().items():
        value, element = getattr(message, name), field.removeprefix("sequence<").rstrip(">")
        if field.startswith("sequence<"):
            package, _, nested = element.partition("/")
            if nested:
                one = filled(getattr(importlib.import_module(f"{package}.msg"), nested))
            else:
                one = {"string": "one", "boolean": True, "double": 1.5, "float": 1.5}.get(
                    element, 1
                )
            setattr(message, name, [one])
        elif hasattr(value, "get_fields_and_field_types"):
            setattr(message, name, filled(type(value)))
    return message


def serialized(topic):
    """A serialized message of the topic's type; /tf is serialized by this stack itself."""
    if topic is topics.TF or topic is topics.TF_STATIC:
        moved = Transform(7 * SECOND, "world", "base_link", (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0))
        message = transforms_message([moved])
        return message if isinstance(message, bytes) else serialize_message(message)
    return serialize_message(filled(topic.type))


@pytest.fixture
def bag(tmp_path) -> Path:
    """The file of a log with two messages of every topic, at 2 s and 5 s."""
    file = tmp_path / "flight" / "log.mcap"
    log = BoundedLog(file, limit=0.0)
    known = [BagTopic(topic.name, type_name(topic.type), topic.qos) for topic in topics.ALL]
    channels = [add_topic(log, topic) for topic in known]
    for time in (5, 2):  # rosbag2 counts from the earliest message, not from the first
        for channel, topic in zip(channels, topics.ALL, strict=True):
            log.write(channel, time * SECOND, time * SECOND, serialized(topic), 1)
    log.close()
    assert write_metadata(log, known)
    return file


def metadata(bag):
    return yaml.safe_load((bag.parent / METADATA).read_text())["rosbag2_bagfile_information"]


@pytest.mark.parametrize("folder", [True, False])
def test_rosbags_reads_every_message_of_every_type(bag, folder):
    with AnyReader([bag.parent if folder else bag]) as reader:
        assert {c.topic for c in reader.connections} == {topic.name for topic in topics.ALL}
        assert (reader.start_time, reader.end_time) == (2 * SECOND, 5 * SECOND + 1)
        seen = {}
        for connection, time, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            assert time in (2 * SECOND, 5 * SECOND)
            seen[connection.topic] = message
    assert {topic.name: type_name(topic.type) for topic in topics.ALL} == {
        name: message.__msgtype__ for name, message in seen.items()
    }
    moved = seen["/tf"].transforms[0]
    assert (moved.child_frame_id, moved.transform.translation.z) == ("base_link", 3.0)


@pytest.mark.parametrize("folder", [True, False])
def test_rosbags_finds_the_offered_qos_of_every_topic(bag, folder):
    expected = {
        topic.name: (
            QosHistory.KEEP_LAST,
            topic.qos.depth,
            QosReliability[topic.qos.reliability.name],
            QosDurability[topic.qos.durability.name],
            FOREVER,
            FOREVER,
            QosLiveliness.AUTOMATIC,
            FOREVER,
            False,
        )
        for topic in topics.ALL
    }
    with Reader(bag.parent if folder else bag) as reader:
        found = {c.topic: tuple(c.ext.offered_qos_profiles[0]) for c in reader.connections}
    assert found == expected


def test_a_log_converts_to_the_other_storage(bag, tmp_path):
    store = get_typestore(Stores.ROS2_JAZZY)
    target = tmp_path / "converted"
    chosen = [(), (), (), ()]
    convert([bag.parent], target, "sqlite3", 9, None, "none", store, store, *chosen)
    with AnyReader([target]) as reader:
        assert sum(1 for _ in reader.messages()) == 2 * len(topics.ALL)


def decode(profile):
    """Decode one QoS profile as rosbag2 does: qos.cpp, convert<rclcpp::QoS>::decode, jazzy."""
    names = {
        # rmw/qos_string_conversions.h
        "history": ("system_default", "keep_last", "keep_all"),
        "reliability": ("system_default", "reliable", "best_effort", "best_available"),
        "durability": ("system_default", "transient_local", "volatile", "best_available"),
        "liveliness": ("system_default", "automatic", "manual_by_topic", "best_available"),
    }
    if isinstance(profile["history"], int):
        policies = {policy: int(profile[policy]) for policy in names}
    else:
        policies = {policy: known.index(profile[policy]) for policy, known in names.items()}
    times = ("deadline", "lifespan", "liveliness_lease_duration")
    spans = {name: (int(profile[name]["sec"]), int(profile[name]["nsec"])) for name in times}
    assert all(0 <= value < 2**64 for span in spans.values() for value in span)
    ros_names = profile["avoid_ros_namespace_conventions"]
    assert ros_names is True or ros_names is False
    return policies, int(profile["depth"]), spans, ros_names


def test_every_policy_is_decoded_by_the_rules_of_rosbag2():
    qos = QoSProfile(
        history=HistoryPolicy.KEEP_ALL,
        depth=7,
        reliability=ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
        deadline=Duration(seconds=1, nanoseconds=5),
        lifespan=Duration(nanoseconds=3),
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
        liveliness_lease_duration=Duration(seconds=2),
        avoid_ros_namespace_conventions=True,
    )
    policies, depth, spans, ros_names = decode(offered_qos(qos))
    assert policies == {"history": 2, "reliability": 2, "durability": 1, "liveliness": 2}
    assert (depth, ros_names) == (7, True)
    assert spans == {
        "deadline": (1, 5),
        "lifespan": (0, 3),
        "liveliness_lease_duration": (2, 0),
    }


def test_channels_and_metadata_offer_the_same(bag):
    from mcap.reader import make_reader

    with bag.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    listed = {
        entry["topic_metadata"]["name"]: entry
        for entry in metadata(bag)["topics_with_message_count"]
    }
    assert len(summary.channels) == len(listed) == len(topics.ALL)
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        about = listed[channel.topic]["topic_metadata"]
        assert (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg")
        assert about["serialization_format"] == "cdr" and about["type"] == schema.name
        assert (
            yaml.safe_load(channel.metadata["offered_qos_profiles"])
            == (about["offered_qos_profiles"])
        )
        assert channel.metadata["topic_type_hash"] == about["type_description_hash"]
        assert about["type_description_hash"].startswith("RIHS01_")
        assert listed[channel.topic]["message_count"] == 2
        policies, depth, spans, _ = decode(about["offered_qos_profiles"][0])
        assert policies["history"] == 1 and depth >= 1 and spans["deadline"] == tuple(FOREVER)


def test_metadata_has_the_fields_of_rosbag2(bag):
    """Every field that yaml.hpp (jazzy) reads of version 9."""
    found = metadata(bag)
    assert found.pop("topics_with_message_count")
    count, begin, span = 2 * len(topics.ALL), 2 * SECOND, 3 * SECOND
    times = {
        "starting_time": {"nanoseconds_since_epoch": begin},
        "duration": {"nanoseconds": span},
        "message_count": count,
    }
    assert found == {
        "version": 9,
        "storage_identifier": "mcap",
        **times,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": ["log.mcap"],
        "files": [{"path": "log.mcap", **times}],
        "custom_data": {},
        "ros_distro": "jazzy",
    }


def test_an_empty_log_is_a_bag(tmp_path):
    log = BoundedLog(tmp_path / "log.mcap", limit=0.0)
    known = [BagTopic("/imu/data", "sensor_msgs/msg/Imu", topics.IMU.qos)]
    add_topic(log, known[0])
    log.close()
    write_metadata(log, known)
    with Reader(tmp_path) as reader:
        assert reader.message_count == 0 and reader.duration == 0


def test_neither_log_nor_metadata_is_overwritten(tmp_path):
    (tmp_path / "log.mcap").write_text("a flight")
    with pytest.raises(FileExistsError):
        BoundedLog(tmp_path / "log.mcap", limit=0.0)
    assert (tmp_path / "log.mcap").read_text() == "a flight"
    (tmp_path / METADATA).write_text("of another log")
    log = BoundedLog(tmp_path / "other.mcap", limit=0.0)
    log.close()
    assert not write_metadata(log, [])
    assert (tmp_path / METADATA).read_text() == "of another log"


def test_the_default_name_is_a_new_bag():
    assert new_log_file("20260102-030405") == Path("log-20260102-030405/log.mcap")
