"""Subscriptions of the page: polled for the newest message of each topic, without callbacks."""

import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.topics import Topic
from uam_msgs_py.node.door import Door
from uam_msgs_py.node.rightful import RightfulNodes

# Before the first tick of a simulated flight every publisher of the control loop counts its
# subscribers. The cockpit must not be counted in place of another node, so it subscribes to LATE
# only after the mission's first status.
EARLY = (
    topics.MISSION_STATUS,
    topics.AUTOPILOT_STATE,
    topics.PREFLIGHT,
    topics.CHECKLIST,
    topics.DIAGNOSTICS,
    topics.CHANGES,
    topics.ROBOT_DESCRIPTION,
    topics.TF,
    topics.TF_STATIC,
    topics.MARKERS,
)
# Messages of every tick: receiving them costs most. They are left out if processor time is short.
EACH_TICK = (
    topics.SETPOINT,
    topics.POSITION_COMMAND,
    topics.ATTITUDE_COMMAND,
    topics.ARM_COMMAND,
    topics.POSITION_ADAPTATION,
    topics.ATTITUDE_ADAPTATION,
    topics.ARM_ADAPTATION,
    topics.CLOCK,
)
LATE = (topics.TRACKING_ERROR, *EACH_TICK, topics.AUTOPILOT_BATTERY)
SERIALIZED = (topics.TF, topics.TF_STATIC)  # taken raw: tf2_msgs may not be installed
WHOLE = (topics.DIAGNOSTICS, topics.CHANGES, topics.TF, topics.TF_STATIC)  # each message counts


class Watch:
    """Polls the topics through `node`, which is not spun."""

    def __init__(self, node: Node, rightful: RightfulNodes):
        """rightful: whose messages are shown."""
        self._node, self._rightful = node, rightful
        self.door = Door(node, tells=True)
        self._late = False
        self._subscriptions: dict[Topic, Any] = {}
        self._arrivals: dict[Topic, float] = {}
        self.sparing = False  # whether EACH_TICK is left out
        for topic in EARLY:
            self._listen(topic)

    def _listen(self, topic: Topic) -> None:
        qos: QoSProfile = topic.qos if topic in EARLY else topics.NEWEST
        raw = topic in SERIALIZED
        self._subscriptions[topic] = self.door.listen(topic, qos, raw, self._rightful)

    def look(self, show: Callable[[Topic, Any], None]) -> None:
        """Call show(topic, message) for new messages: all of WHOLE, the newest of the others."""
        for topic, subscription in list(self._subscriptions.items()):
            newest = None
            for message in self.door.messages(subscription):
                if topic in WHOLE:
                    self.door.accepts(subscription, show, topic, message)
                newest = message
            if newest is None:
                continue
            self._arrivals[topic] = time.monotonic()
            if topic not in WHOLE:
                self.door.accepts(subscription, show, topic, newest)
        if topics.MISSION_STATUS in self._arrivals and not self._late:
            self._late = True
            for topic in LATE:
                if not (self.sparing and topic in EACH_TICK):
                    self._listen(topic)

    def spare(self, sparing: bool) -> None:
        """Leave out the messages of every tick, or receive them again."""
        if sparing == self.sparing:
            return
        self.sparing = sparing
        for topic in EACH_TICK if self._late else ():
            if not sparing:
                self._listen(topic)
            elif topic in self._subscriptions:
                left_out = self._subscriptions.pop(topic)
                self.door.forget(left_out)
                self._node.destroy_subscription(left_out)

    @property
    def silence(self) -> float | None:
        """Wall time [s] since the last message of the control loop; None before the first.

        Topics of WHOLE do not count.
        """
        arrivals = [at for topic, at in self._arrivals.items() if topic not in WHOLE]
        return time.monotonic() - max(arrivals) if arrivals else None
