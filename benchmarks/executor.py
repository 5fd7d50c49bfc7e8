"""CPU time of a control tick under rclpy's executors and under the stack's own spin loop.

    .venv/bin/python benchmarks/executor.py [--ticks 2000]

A process publishes the three messages of a tick (state, reference, position command) at 250 Hz,
as they reach the attitude controller. A node receives them serialized under each executor in turn.
Per executor: CPU time of the node's process per tick, so other load on the machine hardly matters,
and the share of the ticks that were complete.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import time
from functools import partial

import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node

from uam_control.coordinates import coordinates
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import TrajectoryWriter
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.node.executor import LeanExecutor

TOPICS = (topics.STATE, topics.REFERENCE, topics.POSITION_COMMAND)
PERIOD = 0.004  # s, of control ticks
LOCAL = {"ROS_DOMAIN_ID": "87", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def publish() -> None:
    """Publish the messages of a tick every PERIOD until the process is ended."""
    rclpy.init()
    node = Node("source")
    publishers = [node.create_publisher(t.type, t.name, t.qos) for t in TOPICS]
    writer, stamp, due = TrajectoryWriter(coordinates(2)), 0, time.monotonic()
    while True:
        stamp += round(PERIOD * 1e9)
        data = writer.stamped(stamp)
        for publisher in publishers:
            publisher.publish(data)
        due += PERIOD
        time.sleep(max(0.0, due - time.monotonic()))


class Receiver(Node):
    """Counts complete ticks: the last message has arrived, with those before it."""

    triggers = (topics.POSITION_COMMAND.name,)  # of LeanExecutor

    def __init__(self) -> None:
        super().__init__("receiver")
        self.stamps = dict.fromkeys((topic.name for topic in TOPICS), -1)
        self.first, self.last, self.complete = 0, 0, set()
        for topic in TOPICS:
            self.create_subscription(
                topic.type, topic.name, self._receive(topic.name), topic.reading, raw=True
            )

    def _receive(self, name: str):
        def callback(data: bytes) -> None:
            self.stamps[name] = self.last = stamp_of(data)
            self.first = self.first or self.last
            if len(set(self.stamps.values())) == 1:
                self.complete.add(self.last)

        return callback

    @property
    def ticks(self) -> int:
        """Ticks between the first and the newest message."""
        return 1 + round((self.last - self.first) / PERIOD / 1e9)


def spin(executor: Executor | LeanExecutor, node: Receiver, ticks: int) -> None:
    """Receive until `ticks` have passed since the first message."""
    while node.ticks < ticks:
        executor.spin_once(0.1)


def rclpy_executor(kind: type[Executor], node: Receiver) -> Executor:
    """Return an executor of rclpy that has the node."""
    executor = kind()
    executor.add_node(node)
    return executor


KINDS = {
    "LeanExecutor": LeanExecutor,
    "SingleThreadedExecutor": partial(rclpy_executor, SingleThreadedExecutor),
    "EventsExecutor (experimental)": partial(rclpy_executor, EventsExecutor),
}


def main() -> None:
    """Measure the executors one after the other and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--ticks", type=int, default=2000, help="ticks per executor")
    ticks = parser.parse_args().ticks
    os.environ |= LOCAL
    source = multiprocessing.get_context("spawn").Process(target=publish, daemon=True)
    source.start()
    rclpy.init()
    for name, make in KINDS.items():
        node = Receiver()
        executor = make(node)
        spin(executor, node, 100)  # until discovery and the first calls are over
        before, begun = node.ticks, time.process_time()
        spin(executor, node, before + ticks)
        spent, counted = time.process_time() - begun, node.ticks - before
        complete = sum(stamp > node.first + before * PERIOD * 1e9 for stamp in node.complete)
        share = f"{100 * complete / counted:5.1f} % complete"
        print(f"{name:30} {1e6 * spent / counted:6.0f} us per tick, {share}", flush=True)
        executor.shutdown()
        node.destroy_node()
    source.kill()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
