"""Topics that are polled: messages are taken when looked at, not called back; hence no executor."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from uam_msgs_py.messages.topics import Topic


def listen(
    node: Node, topic: Topic, qos: QoSProfile | None = None, raw: bool = False
) -> Subscription:
    """Subscribe to a topic that is to be polled; qos: None for the topic's, raw: serialized."""
    return node.create_subscription(
        topic.type, topic.name, lambda _: None, qos or topic.qos, raw=raw
    )


def messages(subscription: Subscription) -> Iterator[Any]:
    """Take what has arrived, oldest first."""
    kind, raw = subscription.msg_type, subscription.raw
    while (taken := subscription.handle.take_message(kind, raw)) is not None:
        yield taken[0]
