"""The plant's entry of /diagnostics, once a second of wall time."""

import time

from rclpy.node import Node

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.status import ERROR, OK, STALE, WARN, diagnostic
from uam_msgs_py.node.base_node import DIAGNOSTICS_PERIOD
from uam_msgs_py.node.health import LoopTime, ages
from uam_msgs_py.node.namespace import label
from uam_sim_bridge.nodes.latencies import Statistics
from uam_sim_bridge.nodes.plant_topics import Answers, nanoseconds

WAITING = "waiting for "  # begins the summary while time stands still
TICKS = "ticks"  # so far


class PlantHealth:
    """Reports the speed of the simulation, the duration of a tick, and the age of the answers.

    A tick lasts from its sensor samples to the next state: in lockstep until the answers of all
    nodes, in real time for the control period and its overrun.
    """

    def __init__(self, node: Node, answers: Answers, statistics: Statistics):
        self._publisher = topics.DIAGNOSTICS.outlet(node)
        self._name, self._namespace = label(node), node.get_namespace()
        self._answers, self._statistics = answers, statistics
        self._loop = LoopTime()
        self._ticks = 0
        self._log, self._door = node.get_logger(), node.door
        self._missed = 0
        self._last = (time.monotonic(), 0.0)  # wall and simulated time of the last report [s]

    def waiting(self, missing: str, simulated: float = 0.0) -> None:
        """Publish while time stands still at `simulated` [s]; missing: what the plant waits for."""
        if self._due():
            self._publish(simulated, STALE, f"{WAITING}{missing}")

    def done_tick(self, begun: float, simulated: float) -> None:
        """Register a tick from time.perf_counter() `begun` [s] on, up to `simulated` time [s]."""
        self._loop.add(begun)
        self._ticks += 1
        if not self._due():
            return
        missed = self._statistics.missed_ticks - self._missed
        self._missed = self._statistics.missed_ticks
        if missed:
            self._publish(simulated, WARN, f"{missed} ticks missed in the last second")
        else:
            self._publish(simulated, OK, "running")

    def _due(self) -> bool:
        return time.monotonic() - self._last[0] >= DIAGNOSTICS_PERIOD

    def _publish(self, simulated: float, level: bytes, summary: str) -> None:
        wall, before = self._last
        now = time.monotonic()
        self._last = now, simulated
        if new := self._door.news():
            level, summary = ERROR, "; ".join(new)
            self._log.error(summary)
        values = {
            TICKS: self._ticks,
            "real time factor": f"{(simulated - before) / (now - wall):.2f}",
            "ticks missed": self._statistics.missed_ticks,
            "late motor commands": self._statistics.late_motor_commands,
            **self._door.values(),
        }
        values |= self._loop.report() | ages(
            self._answers.inlets, self._answers.arrivals, self._namespace
        )
        self._publisher.publish(
            diagnostic(nanoseconds(simulated), self._name, level, summary, values)
        )
