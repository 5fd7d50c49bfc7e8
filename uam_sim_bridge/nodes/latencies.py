"""Latency from an IMU sample to its setpoint, in real time."""

from uam_control.stamps import nanoseconds
from uam_sim_bridge.nodes.plant_options import Statistics

MOST_UNANSWERED = 1000  # samples without a setpoint that are kept
# [control periods] from a sample to its setpoint, beyond which the tick is missed: at 250 Hz 12 ms,
# about a rotor's time constant
DEADLINE_TICKS = 3


class Latencies:
    """Measures the time from each sample to its setpoint; the results go to `statistics`."""

    def __init__(self, statistics: Statistics, period: float):
        """period: of the control ticks [s]."""
        self._statistics, self._period = statistics, period
        self._unanswered: dict[int, int] = {}  # stamp [ns] → wall time of publication [ns]

    def tick(self, stamp: int | None, published: int, setpoints: dict[int, int]) -> None:
        """Register a tick's sample, None for none, and the setpoints that have arrived.

        published: wall time [ns]; setpoints: stamp of the sample answered [ns] → wall time [ns].
        """
        numbers = self._statistics
        if stamp is not None:
            self._unanswered[stamp] = published
            numbers.answerable_ticks += 1
            if len(self._unanswered) > MOST_UNANSWERED:  # without a companion, for hours
                del self._unanswered[next(iter(self._unanswered))]
                self._count_missed(1)
        for answered, sent in setpoints.items():
            sample = self._answered(answered)
            if sample is None:
                continue
            latency = (sent - self._unanswered.pop(sample)) * 1e-9
            numbers.latency_s.append(latency)
            numbers.late_ticks += latency > self._period
            numbers.missed_ticks += latency > DEADLINE_TICKS * self._period

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
        self._statistics.late_ticks += never
        self._statistics.missed_ticks += never
