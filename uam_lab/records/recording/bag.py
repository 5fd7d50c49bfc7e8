"""What makes a log a bag of ROS 2: the offered QoS of each channel, and metadata.yaml beside it.

Both are in the form that rosbag2 of ROS 2 Jazzy writes (bag version 9; `ros2 bag record`).
Source: ros2/rosbag2, branch jazzy, rosbag2_storage/src/rosbag2_storage/qos.cpp and
include/rosbag2_storage/yaml.hpp.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from rclpy.duration import Duration
from rclpy.qos import (
    QoSDurabilityPolicy,
    QoSHistoryPolicy,
    QoSLivelinessPolicy,
    QoSProfile,
    QoSReliabilityPolicy,
)

from uam_control.stamps import SECOND
from uam_lab.records.recording.bounded_log import BoundedLog
from uam_lab.records.recording.message_definitions import schema, type_hash
from uam_lab.records.results.atomic import write_text

METADATA = "metadata.yaml"
VERSION = 9  # of the bag's metadata: policies of the QoS by name, QoS profiles as a list
ROS_DISTRO = "jazzy"
INFINITE = {"sec": 9223372036, "nsec": 854775807}  # RMW_DURATION_INFINITE: no deadline, no end
HISTORY = {QoSHistoryPolicy.KEEP_LAST: "keep_last", QoSHistoryPolicy.KEEP_ALL: "keep_all"}
RELIABILITY = {
    QoSReliabilityPolicy.RELIABLE: "reliable",
    QoSReliabilityPolicy.BEST_EFFORT: "best_effort",
}
DURABILITY = {
    QoSDurabilityPolicy.TRANSIENT_LOCAL: "transient_local",
    QoSDurabilityPolicy.VOLATILE: "volatile",
}
LIVELINESS = {
    QoSLivelinessPolicy.SYSTEM_DEFAULT: "automatic",  # the default of DDS
    QoSLivelinessPolicy.AUTOMATIC: "automatic",
    QoSLivelinessPolicy.MANUAL_BY_TOPIC: "manual_by_topic",
}


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag: its name, type `package/msg/Name`, and what its publisher offers."""

    name: str
    type_name: str
    qos: QoSProfile


def add_topic(log: BoundedLog, topic: BagTopic) -> int:
    """Add the topic's channel to the log, with its schema; return the channel's id."""
    metadata = {
        "offered_qos_profiles": yaml.safe_dump([offered_qos(topic.qos)], sort_keys=False).strip(),
        "topic_type_hash": type_hash(topic.type_name),
    }
    return log.add_channel(topic.name, topic.type_name, schema(topic.type_name), metadata)


def write_metadata(log: BoundedLog, topics: list[BagTopic]) -> bool:
    """Write metadata.yaml beside the log; return False if the folder already has one.

    That one belongs to another bag and is kept.
    """
    file = log.file.parent / METADATA
    if file.exists():
        return False
    bag = {"rosbag2_bagfile_information": information(log, topics)}
    write_text(file, yaml.safe_dump(bag, sort_keys=False))
    return True


def information(log: BoundedLog, topics: list[BagTopic]) -> dict[str, Any]:
    """Return the content of metadata.yaml: rosbag2's BagMetadata, version 9."""
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        **_extent(log),
        "topics_with_message_count": [_counted(topic, log.counts) for topic in topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [log.file.name],
        "files": [{"path": log.file.name, **_extent(log)}],
        "custom_data": {},
        "ros_distro": ROS_DISTRO,
    }


def _extent(log: BoundedLog) -> dict[str, Any]:
    return {
        "starting_time": {"nanoseconds_since_epoch": log.begin},
        "duration": {"nanoseconds": log.end - log.begin},
        "message_count": log.counts.total(),
    }


def _counted(topic: BagTopic, counts: Mapping[str, int]) -> dict[str, Any]:
    metadata = {
        "name": topic.name,
        "type": topic.type_name,
        "serialization_format": "cdr",
        "offered_qos_profiles": [offered_qos(topic.qos)],
        "type_description_hash": type_hash(topic.type_name),
    }
    return {"topic_metadata": metadata, "message_count": counts[topic.name]}


def offered_qos(qos: QoSProfile) -> dict[str, Any]:
    """Return all policies of a QoS profile as rosbag2 names them."""
    return {
        "history": HISTORY[qos.history],
        "depth": qos.depth,
        "reliability": RELIABILITY[qos.reliability],
        "durability": DURABILITY[qos.durability],
        "deadline": _time(qos.deadline),
        "lifespan": _time(qos.lifespan),
        "liveliness": LIVELINESS[qos.liveliness],
        "liveliness_lease_duration": _time(qos.liveliness_lease_duration),
        "avoid_ros_namespace_conventions": qos.avoid_ros_namespace_conventions,
    }


def _time(duration: Duration) -> dict[str, int]:
    """Return a duration; 0, "not specified", is infinite in DDS."""
    seconds, rest = divmod(duration.nanoseconds, SECOND)
    return {"sec": seconds, "nsec": rest} if duration.nanoseconds else dict(INFINITE)


def new_log_file(stamp: str, parent: Path = Path()) -> Path:
    """Return `log-<stamp>/log-<stamp>.mcap` in `parent`: a bag of ROS 2 is a folder."""
    name = f"log-{stamp}"
    return parent / name / f"{name}.mcap"
