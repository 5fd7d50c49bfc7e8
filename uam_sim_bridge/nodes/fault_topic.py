"""/uam/faults: each fault that begins or ends."""

from collections.abc import Iterable

from rclpy.node import Node

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.flight_events import FaultEvent
from uam_sim_bridge.faults.timeline import FaultState


class FaultTopic:
    """Publishes the beginning and end of faults."""

    def __init__(self, node: Node):
        self._publisher = topics.FAULTS.outlet(node)

    def publish(self, stamp: int, changed: Iterable[FaultState]) -> None:
        """Publish the events at `stamp` [ns]."""
        for one in changed:
            fault = one.fault
            event = FaultEvent(fault.NAME, fault.PLACE, one.number, one.active, fault.to_mapping())
            self._publisher.publish(event.to_message(stamp))
