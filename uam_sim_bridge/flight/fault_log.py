"""Faults on their way to the log, and back from it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.serialization import deserialize_message

from uam_msgs_py import topics
from uam_msgs_py.faults import FaultEvent
from uam_sim_bridge.faults.timeline import Happened, record

SECOND = 1e9


class FaultTopic:
    """Publishes what came and went."""

    def __init__(self, node: Node):
        topic = topics.FAULTS
        self._publisher = node.create_publisher(topic.type, topic.name, topic.qos)

    def tell(self, stamp: int, changed: Iterable[Happened]) -> None:
        """Publish the events of the moment `stamp` [ns]."""
        for one in changed:
            fault = one.fault
            event = FaultEvent(fault.NAME, fault.PLACE, one.number, one.active, fault.values)
            self._publisher.publish(event.to_message(stamp))


def records(messages: Iterable[bytes], takeoff: int) -> list[dict[str, Any]]:
    """What a log tells, see `timeline.record`; takeoff: stamp [ns] of mission time 0."""
    found: dict[tuple[str, int], dict[str, Any]] = {}
    for data in messages:
        stamp, event = FaultEvent.from_message(deserialize_message(data, DiagnosticArray))
        time, key = (stamp - takeoff) / SECOND, (event.place, event.number)
        if event.active:
            found[key] = record(event.name, time, None, event.parameters)
        elif key in found:
            found[key]["end_s"] = round(time, 6)
    return sorted(found.values(), key=lambda entry: entry["begin_s"])
