"""Polling of topics: the program takes messages when it needs them, without executor."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, TypeVar

from rclpy.callback_groups import CallbackGroup
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.topics import Topic
from uam_msgs_py.node.sole_publisher import SolePublisher

T = TypeVar("T")


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


def messages(subscription: Subscription, guard: SolePublisher | None = None) -> Iterator[Any]:
    """Take and yield the received messages, oldest first; guard: of the subscription, if any."""
    kind, raw, take = subscription.msg_type, subscription.raw, guard or subscription.handle
    while (taken := take.take_message(kind, raw)) is not None:
        yield taken[0]


def decoded(
    subscription: Subscription, decode: Callable[[Any], T], guard: SolePublisher | None = None
) -> Iterator[T]:
    """Yield `decode(message)` of each message; one that raises BadMessage is skipped.

    Anyone may send one: it must not end a program that watches a flight.
    """
    for message in messages(subscription, guard):
        try:
            found = decode(message)
        except BadMessage:
            _warn_once(subscription.logger_name, subscription.topic_name)
            continue
        yield found


@cache
def _warn_once(logger: str, topic: str) -> None:
    get_logger(logger).warning(f"{topic}: messages that cannot be read are skipped")
