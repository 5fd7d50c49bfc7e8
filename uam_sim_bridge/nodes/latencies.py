"""Statistics of the plant, with the latency from an IMU sample to its setpoint in real time."""

from __future__ import annotations

from array import array
from dataclasses import InitVar, dataclass, field, fields

from uam_control.stamps import nanoseconds

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
