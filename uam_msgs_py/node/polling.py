"""Polling of topics: the program takes messages by its `Door` when it needs them."""

from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from uam_msgs_py.messages.topics import Topic


class Polled(CallbackGroup):
    """Callback group of subscriptions that no executor serves: it would discard their messages."""

    def can_execute(self, entity: Any) -> bool:
        """Return False: an executor leaves the entity alone."""
        return False

    def beginning_execution(self, entity: Any) -> bool:
        """Return False, as `can_execute`."""
        return False

    def ending_execution(self, entity: Any) -> None:
        """Do nothing: nothing was executed."""


def listen(
    node: Node, topic: Topic, qos: QoSProfile | None = None, raw: bool = False
) -> Subscription:
    """Return a subscription for polling; qos: None for the topic's, raw: serialized messages."""
    return node.create_subscription(
        topic.type,
        topic.name,
        lambda _: None,
        qos or topic.qos,
        raw=raw,
        callback_group=Polled(),
    )
