"""Stamps of the control ticks from the stamps of IMU samples, without their jitter.

A real IMU driver stamps a sample late by a random time, repeats a sample or loses one. Every stage
joins its inputs by stamp and the mission computes one tick ahead; both need ticks that lie one
control period apart. The IMU sample still starts the tick. Its tick stamp is the last one plus one
period, or plus several if samples are missing. The mean difference to the IMU's stamps is measured;
if it becomes large, because the two clocks drift apart, the tick stamps are shifted by it.

The stamps of a simulated IMU are exact multiples of the period and are not changed.
"""

from __future__ import annotations

from collections import deque

MISSING = 0.75  # [periods] of delay from which the sample before is counted as missing
GAIN = 0.02  # of the low-pass on the difference: 50 samples
SHIFT = 0.2  # [periods] of mean difference from which the ticks are shifted
LONG = 10  # [periods] without a sample after which the ticks begin anew
WINDOW = 100  # samples over which the IMU's period is measured
OTHER_RATE = 0.1  # relative difference of the measured period from which stamps are not changed


class TickStamps:
    """The stamp of the newest tick, and numbers of repeated and missing samples."""

    def __init__(self, period: int) -> None:
        """period [ns]: control period, the nominal period of the IMU."""
        self.period, self.stamp = period, -1
        self.repeated = self.missing = 0
        self._sample = -1  # stamp [ns] of the newest sample
        self._difference = 0.0  # [ns] mean of sample - tick
        self._window: deque[int] = deque(maxlen=WINDOW + 1)

    def follows(self, sample: int) -> bool:
        """Return whether a sample of this stamp [ns] starts a tick; count a repeated one.

        Stamps of neighbouring samples may be exchanged by jitter, older ones are no new samples.
        """
        if sample == self._sample:
            self.repeated += 1
            return False
        return sample > self._sample - self.period or self.stamp < 0

    def next(self, sample: int) -> int:
        """Return the stamp [ns] of the tick that the sample of stamp `sample` [ns] starts."""
        self._sample = sample
        self._window.append(sample)
        late = sample - self.stamp - self.period
        if not late and not self._difference:  # the exact stamps of a simulation
            self.stamp = sample
            return sample
        if self.stamp < 0 or late > LONG * self.period or self._other_rate():
            self.stamp, self._difference = max(sample, self.stamp + 1), 0.0
            return self.stamp
        gap = max(0, int(late / self.period + 1.0 - MISSING))
        self.missing += gap
        self._difference += GAIN * (late - gap * self.period - self._difference)
        self.stamp += (1 + gap) * self.period
        if abs(self._difference) > SHIFT * self.period:
            self.stamp += round(self._difference)
            self._difference = 0.0
        return self.stamp

    def _other_rate(self) -> bool:
        """Return whether the measured period is not the control period."""
        window = self._window
        if len(window) <= WINDOW:
            return False
        measured = (window[-1] - window[0]) / WINDOW
        return abs(measured - self.period) > OTHER_RATE * self.period
