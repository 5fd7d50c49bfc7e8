"""Load conditions: processes beside the flight, and fewer cores for it."""

from __future__ import annotations

import multiprocessing
import os
import socket
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from uam_lab.flights.processes.node_environment import ros_environment
from uam_sim_bridge.ports import in_use

BLOCK = 8_000_000  # bytes
BLOCKS = 16  # per file, before it is overwritten
WAIT = 0.2  # [s]
LISTENERS = 20  # ten times the number of subscribers to /diagnostics in a flight


@dataclass(frozen=True)
class Condition:
    """cores: number for the flight, None for all. beside: functions and their numbers of processes,
    called with the flight's folder and ROS domain."""

    name: str
    cores: int | None = None
    beside: tuple[tuple[Callable[[Path, int], None], int], ...] = ()


def hog(folder: Path, domain: int) -> None:
    """Use a core completely."""
    while True:
        sum(range(100_000))


def writer(folder: Path, domain: int) -> None:
    """Load the disk with synchronous writes."""
    block = os.urandom(BLOCK)
    with tempfile.TemporaryFile(dir=folder) as file:
        while True:
            file.seek(0)
            for _ in range(BLOCKS):
                file.write(block)
                file.flush()
                os.fsync(file.fileno())


def discovery_port(domain: int) -> int:
    """Return the UDP port of the first participant's discovery (RTPS 2.2, 9.6.1.1)."""
    return 7410 + 250 * domain


def listener(folder: Path, domain: int) -> None:
    """Receive every message of /diagnostics, after the start of the flight."""
    while not in_use(socket.SOCK_DGRAM, discovery_port(domain)):
        time.sleep(WAIT)
    os.environ.update(ros_environment(domain, folder))
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray

    rclpy.init(args=["--ros-args", "--disable-external-lib-logs"])
    node = rclpy.create_node(f"listener_{os.getpid()}")
    node.create_subscription(DiagnosticArray, "/diagnostics", lambda message: None, 10)
    rclpy.spin(node)


CONDITIONS = (
    Condition("no load"),
    Condition("every core has a hog", beside=((hog, os.cpu_count() or 1),)),
    Condition("slow disk", beside=((writer, 2),)),
    Condition("10 x the listeners to /diagnostics", beside=((listener, LISTENERS),)),
    Condition("one core", cores=1),
    Condition("one core, and a hog on it", cores=1, beside=((hog, 1),)),
)


@contextmanager
def under(condition: Condition, folder: Path, domain: int) -> Iterator[None]:
    """Context manager with the load and the cores of a condition; child processes inherit both."""
    before = os.sched_getaffinity(0)
    if condition.cores is not None:
        os.sched_setaffinity(0, set(sorted(before)[: condition.cores]))
    context = multiprocessing.get_context("spawn")
    running = [
        context.Process(target=run, args=(folder, domain), daemon=True)
        for run, count in condition.beside
        for _ in range(count)
    ]
    try:
        for one in running:
            one.start()
        yield
    finally:
        for one in running:
            one.kill()
            one.join()
        os.sched_setaffinity(0, before)
