"""A second recorder in a flight's domain, with some of the topics: a program, and how to run it."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from uam_lab.flights.processes.node_environment import ros_environment
from uam_lab.records.recording.topic_recorder import TopicRecorder
from uam_msgs_py.messages import topics
from uam_msgs_py.node.base_node import StopSignal
from uam_msgs_py.node.rightful import RightfulNodes
from uam_msgs_py.node.wiring import WIRES

POLL_PERIOD = 0.02  # [s] as that of the recorder
# the topics of every tick first: they are what costs
CHOSEN = [*dict.fromkeys([*(wire.topic for wire in WIRES), *topics.RECORDED])]


@contextmanager
def recording(count: int, domain: int, folder: Path) -> Iterator[None]:
    """Context manager: record so many topics of a ROS domain to `folder`."""
    command = [sys.executable, __file__, str(count), str(folder / "further.mcap")]
    surroundings = os.environ | ros_environment(domain, folder)
    surroundings["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
    process = subprocess.Popen(command, env=surroundings)
    try:
        yield
    finally:
        process.terminate()
        process.wait()


def main() -> int:
    """Record until SIGTERM; return the exit status."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    count, file = int(sys.argv[1]), Path(sys.argv[2])
    stop = StopSignal()
    rclpy.init(args=None, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("further_recorder")
    recorder = TopicRecorder(node, file, CHOSEN[:count], True, RightfulNodes("/", "any"))
    while not stop.raised:
        time.sleep(POLL_PERIOD)
        recorder.poll()
    recorder.drain()
    recorder.close()
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
