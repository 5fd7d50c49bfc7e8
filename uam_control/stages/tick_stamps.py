"""Stamps of the control ticks, and the reference that serves a tick.

The stamps follow from those of IMU samples, without their jitter.

A real IMU driver stamps a sample late by a random time, repeats a sample or loses one. Every stage
joins its inputs by stamp and the mission computes one tick ahead; both need ticks that lie one
control period apart. The IMU sample still starts the tick. Its tick stamp is the last one plus one
period, or plus several if samples are missing. The mean difference to the IMU's stamps is measured;
if it becomes large, because the two clocks drift apart, the tick stamps are shifted by it.

The stamps of a simulated IMU are exact multiples of the period and are not changed.

At a tick the mission publishes one reference, for the stamp one control period later. The next tick
has another stamp if an IMU sample is missing or the IMU's clock drifts. This reference serves it
too, carried on by its own rates; the error is of third order in the difference.
"""

from dataclasses import dataclass

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import Number, record
from uam_control.settings.parameter_set import ParameterSet, number
from uam_control.stamps import SECOND

MISSING = 0.75  # [periods] of delay from which the sample before is counted as missing
GAIN = 0.02  # of the low-pass on the difference: 50 samples
SHIFT = 0.2  # [periods] of mean difference from which the ticks are shifted
LONG = 10  # [periods] without a sample after which the ticks begin anew
WINDOW = 100  # samples over which the IMU's period is measured
OTHER_RATE = 0.1  # relative difference of the measured period from which stamps are not changed
# sample: stamp [ns] of the newest one; kept: how many were kept in the window; difference [ns]:
# mean of sample - tick
WHOLE, REAL = "period stamp sample repeated missing kept", "difference"


@dataclass(frozen=True)
class Timing(ParameterSet):
    """Parameters of the control ticks."""

    control_period: float = number(0.004, "time between two control ticks", "s", 1e-4, 0.1)

    @property
    def period(self) -> int:
        """The control period [ns]."""
        return round(self.control_period * SECOND)


class TickStamps:
    """The stamp [ns] of the newest tick, and numbers of repeated and missing samples.

    window (WINDOW + 1,): stamps [ns] of the newest samples, in a ring.
    """

    stamp, repeated, missing = Number(), Number(), Number()

    def __init__(self, period: int) -> None:
        """period [ns]: control period, the nominal period of the IMU."""
        self.memory, self.window = record(WHOLE, REAL), np.zeros(WINDOW + 1, dtype=np.int64)
        self.memory[0] = period, -1, -1, 0, 0, 0, 0.0


@borrowing
def follows(ticks: np.ndarray, sample: int) -> bool:
    """Return whether a sample of this stamp [ns] starts a tick; count a repeated one.

    ticks (1,): memory of `TickStamps`. Stamps of neighbouring samples may be exchanged by jitter,
    older ones are no new samples.
    """
    m = ticks[0]
    if sample == m.sample:
        m.repeated += 1
        return False
    return sample > m.sample - m.period or m.stamp < 0


@borrowing
def next_stamp(ticks: np.ndarray, window: np.ndarray, sample: int) -> int:
    """Return the stamp [ns] of the tick that the sample of stamp `sample` [ns] starts."""
    m = ticks[0]
    m.sample = sample
    window[m.kept % len(window)] = sample
    m.kept += 1
    late = sample - m.stamp - m.period
    if late == 0 and m.difference == 0.0:  # the exact stamps of a simulation
        m.stamp = sample
        return sample
    if m.stamp < 0 or late > LONG * m.period or other_rate(m, window):
        m.stamp, m.difference = max(sample, m.stamp + 1), 0.0
        return m.stamp
    gap = max(0, int(late / m.period + 1.0 - MISSING))
    m.missing += gap
    m.difference += GAIN * (late - gap * m.period - m.difference)
    m.stamp += (1 + gap) * m.period
    if abs(m.difference) > SHIFT * m.period:
        m.stamp += int(np.rint(m.difference))
        m.difference = 0.0
    return m.stamp


@borrowing
def other_rate(m: np.record, window: np.ndarray) -> bool:
    """Return whether the measured period is not the control period."""
    if m.kept <= WINDOW:
        return False
    newest, oldest = window[(m.kept - 1) % len(window)], window[m.kept % len(window)]
    measured = (newest - oldest) / WINDOW
    return abs(measured - m.period) > OTHER_RATE * m.period


def serves(reference: int, before: int, stamp: int, period: int) -> bool:
    """Return whether the reference of a stamp serves the tick `stamp`; all in [ns].

    before: stamp of the tick before, -1 without one. period: control period. After LONG periods
    without a tick nothing that was published before is used.
    """
    recent = 0 <= before < stamp <= before + LONG * period
    return recent and before < reference < stamp + period // 2


def carried(reference: np.ndarray, step: int) -> np.ndarray:
    """Return the reference (3, 6 + n) chi_d, chi_d_dot, chi_d_ddot, `step` [ns] later."""
    dt = step / SECOND
    value, rate, bend = reference
    return np.array([value + dt * rate + 0.5 * dt * dt * bend, rate + dt * bend, bend])
