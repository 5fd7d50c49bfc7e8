"""Waits for the input of the next tick: asleep, or at first without sleeping."""

import time
from collections.abc import Sequence
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation

WaitSet = rclpy_implementation.WaitSet  # not part of rclpy's public API


def wait_for(
    messages: WaitSet, inputs: Sequence[Any], timeout: float, busy_poll: float = 0.0
) -> None:
    """Wait until one of `inputs` has a message, at most `timeout` [s].

    messages: a wait set for them; inputs: handles of subscriptions; without any it sleeps.
    busy_poll: time [s] in which it looks again and again before it sleeps; the message then needs
    no wake-up of this thread by the system.
    """
    if not inputs:
        time.sleep(timeout)
        return
    end = time.monotonic() + min(busy_poll, timeout) if busy_poll else 0.0
    asleep = not end
    while True:
        messages.clear_entities()
        for handle in inputs:
            messages.add_subscription(handle)
        messages.wait(int(timeout * 1e9) if asleep else 0)
        if asleep or messages.get_ready_entities("subscription"):
            return
        asleep = time.monotonic() >= end
