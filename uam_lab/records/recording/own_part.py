"""The part of the topics shared by all vehicles that belongs to one of them.

`/tf`, `/tf_static`, `/diagnostics` and `/rosout` have no namespace. The log of a vehicle in one
keeps the frames, status names and loggers of its namespace.
"""

from __future__ import annotations

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log
from rclpy.serialization import serialize_message

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.serialized import deserialized
from uam_msgs_py.messages.transforms import read_transforms, transforms_message
from uam_msgs_py.node.namespace import prefix

# a serialized message → the part to keep, None: nothing; raises BadMessage
Filter = Callable[[bytes], bytes | None]


def own_part(topic: topics.Topic, namespace: str) -> Filter | None:
    """Return the filter of a topic for a vehicle; None where every message is its own."""
    own = prefix(namespace)
    chosen = {
        topics.TF: _frames,
        topics.TF_STATIC: _frames,
        topics.DIAGNOSTICS: _statuses,
        topics.ROSOUT: _lines,
    }.get(topic)
    return None if chosen is None or not own else lambda data: chosen(data, own)


def _frames(data: bytes, own: str) -> bytes | None:
    every = read_transforms(data)
    kept = [one for one in every if one.parent.startswith(own) or one.child.startswith(own)]
    if len(kept) == len(every):
        return data
    return transforms_message(kept) if kept else None


def _statuses(data: bytes, own: str) -> bytes | None:
    message = deserialized(data, DiagnosticArray)
    kept = [status for status in message.status if status.name.startswith(own)]
    if len(kept) == len(message.status):
        return data
    message.status = kept
    return serialize_message(message) if kept else None


def _lines(data: bytes, own: str) -> bytes | None:
    """Keep the lines of loggers such as `uav1.mission`."""
    return data if deserialized(data, Log).name.startswith(own.replace("/", ".")) else None
