"""Statistics of the plant, and its entry of /diagnostics, once a second of wall time."""

from __future__ import annotations

import time
from array import array
from dataclasses import InitVar, dataclass, field, fields

from rclpy.node import Node

from uam_control.stamps import nanoseconds
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.status import ERROR, OK, STALE, WARN, diagnostic
from uam_msgs_py.node.base_node import DIAGNOSTICS_PERIOD
from uam_msgs_py.node.health import LoopTime, ages
from uam_msgs_py.node.namespace import label
from uam_sim_bridge.nodes.plant_topics import Answers

WAITING = "waiting for "  # begins the summary while time stands still
TICKS = "ticks"  # so far
MOST_UNANSWERED = 1000  # samples without a setpoint that are kept
# [control periods] from a sample to its setpoint, beyond which the tick is missed: at 250 Hz 12 ms,
# about a rotor's time constant
DEADLINE_TICKS = 3


@dataclass
class Statistics:
    """Statistics of the flight, written at the end; period: of the control ticks [s]."""

    clock: str
    period: InitVar[float]
    ticks: int = 0
    simulated_s: float = 0.0
    wall_s: float = 0.0
    answerable_ticks: int = 0  # realtime: ticks with an IMU sample, which require a setpoint
    missed_ticks: int = 0
    late_ticks: int = 0
    late_motor_commands: int = 0
    latency_s: array[float] = field(default_factory=lambda: array("f"))  # 4 bytes: long flights
    ended_by: str = ""

    def __post_init__(self, period: float) -> None:
        self._period = period
        self._unanswered: dict[int, int] = {}  # stamp [ns] → wall time of publication [ns]

    def to_mapping(self) -> dict[str, object]:
        """Return the values for JSON; latencies rounded to the microsecond."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        return values | {"latency_s": [round(value, 6) for value in self.latency_s]}

    def tick(self, stamp: int | None, published: int, setpoints: dict[int, int]) -> None:
        """Register a tick's sample, None for none, and the setpoints that have arrived.

        published: wall time [ns]; setpoints: stamp of the sample answered [ns] → wall time [ns].
        """
        if stamp is not None:
            self._unanswered[stamp] = published
            self.answerable_ticks += 1
            if len(self._unanswered) > MOST_UNANSWERED:  # without a companion, for hours
                del self._unanswered[next(iter(self._unanswered))]
                self._count_missed(1)
        for answered, sent in setpoints.items():
            sample = self._answered(answered)
            if sample is None:
                continue
            latency = (sent - self._unanswered.pop(sample)) * 1e-9
            self.latency_s.append(latency)
            self.late_ticks += latency > self._period
            self.missed_ticks += latency > DEADLINE_TICKS * self._period

    def _answered(self, stamp: int) -> int | None:
        """Return the unanswered sample nearest to `stamp` [ns], less than one period from it.

        An IMU with drift, and the autopilot's, have stamps beside those of the plant's ticks.
        """
        period = nanoseconds(self._period)
        before = stamp // period * period
        near = [s for s in (before, before + period) if s in self._unanswered]
        near = [s for s in near if abs(s - stamp) < period]
        return min(near, key=lambda s: abs(s - stamp), default=None)

    def conclude(self, now: int) -> None:
        """Count unanswered samples as missed if their deadline is over at `now` [ns]."""
        underway = DEADLINE_TICKS * self._period * 1e9
        self._count_missed(sum(now - sent > underway for sent in self._unanswered.values()))
        self._unanswered.clear()

    def _count_missed(self, never: int) -> None:
        """Count samples that never had a setpoint."""
        self.late_ticks += never
        self.missed_ticks += never


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
