"""What makes a log a bag of ROS 2: the offered QoS of each channel, and metadata.yaml beside it.

Both are in the form that rosbag2 of ROS 2 Jazzy writes (bag version 9; `ros2 bag record`).
Source: ros2/rosbag2, branch jazzy, rosbag2_storage/src/rosbag2_storage/qos.cpp and
include/rosbag2_storage/yaml.hpp.
"""

import importlib.util
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from rclpy.duration import Duration
from rclpy.qos import QoSLivelinessPolicy, QoSProfile

from uam_control.settings.atomic import write_text
from uam_control.stamps import SECOND
from uam_lab.records.recording.bounded_log import BoundedLog
from uam_msgs_py.messages import tf_message

METADATA = "metadata.yaml"
VERSION = 9  # of the bag's metadata: policies of the QoS by name, QoS profiles as a list
ROS_DISTRO = "jazzy"
INFINITE = {"sec": 9223372036, "nsec": 854775807}  # RMW_DURATION_INFINITE: no deadline, no end
AUTOMATIC = QoSLivelinessPolicy.AUTOMATIC  # the default of DDS
SEPARATOR = "=" * 80


class DefinitionMissing(LookupError):
    """The .msg file of a type was not found; the text is one line."""


@cache
def definition(type_name: str) -> str:
    """Return the .msg text of `package/msg/Name`. Raises DefinitionMissing."""
    own = _own(type_name)
    return tf_message.DEFINITION if own else _file(type_name, "msg").read_text(encoding="utf-8")


@cache
def type_hashes(type_name: str) -> dict[str, str]:
    """Return the hashes by which ROS compares types, `RIHS01_...`: of `package/msg/Name`, and of
    the types in it at any depth. Raises DefinitionMissing."""
    if _own(type_name):
        own = {type_name: f"RIHS01_{tf_message.HASH.hex()}"}
        return own | type_hashes(tf_message.ELEMENT)
    listed = json.loads(_file(type_name, "json").read_text(encoding="utf-8"))["type_hashes"]
    return {one["type_name"]: one["hash_string"] for one in listed}


def _own(type_name: str) -> bool:
    """Return whether the type is the one that this project brings itself."""
    package = type_name.partition("/")[0]
    return package == tf_message.PACKAGE and importlib.util.find_spec(package) is None


def _file(type_name: str, suffix: str) -> Path:
    """Return the file of a type in share/<package>/msg. Raises DefinitionMissing."""
    package, _, name = type_name.partition("/msg/")
    module = importlib.util.find_spec(package)
    if module is None or module.origin is None:
        raise DefinitionMissing(f"message package {package} is not installed")
    # in wheels and apt installations, lib/pythonX.Y/site-packages/<package> and share/<package>
    # have a common parent folder
    for prefix in Path(module.origin).parents:
        file = prefix / "share" / package / "msg" / f"{name}.{suffix}"
        if file.is_file():
            return file
    raise DefinitionMissing(f"no definition of {type_name} above {module.origin}")


@cache
def schema(type_name: str) -> str:
    """Return the complete `ros2msg` schema of `package/msg/Name`.

    Raises DefinitionMissing if a required package is not installed.
    """
    parts = [definition(type_name)]
    for name in type_hashes(type_name):
        if name != type_name:
            head = f"{SEPARATOR}\nMSG: {name.replace('/msg/', '/')}"
            parts.append(f"{head}\n{definition(name)}")
    return "\n".join(part.rstrip("\n") for part in parts) + "\n"


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
        "topic_type_hash": type_hashes(topic.type_name)[topic.type_name],
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
        "type_description_hash": type_hashes(topic.type_name)[topic.type_name],
    }
    return {"topic_metadata": metadata, "message_count": counts[topic.name]}


def offered_qos(qos: QoSProfile) -> dict[str, Any]:
    """Return all policies of a QoS profile as rosbag2 names them."""
    usual = qos.liveliness == QoSLivelinessPolicy.SYSTEM_DEFAULT
    return {
        "history": qos.history.short_key,
        "depth": qos.depth,
        "reliability": qos.reliability.short_key,
        "durability": qos.durability.short_key,
        "deadline": _time(qos.deadline),
        "lifespan": _time(qos.lifespan),
        "liveliness": (AUTOMATIC if usual else qos.liveliness).short_key,
        "liveliness_lease_duration": _time(qos.liveliness_lease_duration),
        "avoid_ros_namespace_conventions": qos.avoid_ros_namespace_conventions,
    }


def _time(duration: Duration) -> dict[str, int]:
    """Return a duration; 0, "not specified", is infinite in DDS."""
    seconds, rest = divmod(duration.nanoseconds, SECOND)
    return {"sec": seconds, "nsec": rest} if duration.nanoseconds else dict(INFINITE)


def new_log_file(stamp: str) -> Path:
    """Return `log-<stamp>/log.mcap`: a bag of ROS 2 is a folder, and `uam report` reads it."""
    return Path(f"log-{stamp}") / "log.mcap"
