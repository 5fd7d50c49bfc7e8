"""Delay of the attitude loop, measured in flight: from a body-rate setpoint to the gyro's response.

The autopilot's rate loop turns the vehicle with the angular acceleration

    omega_dot(t) = g lag( omega_sp(t - T) - omega(t) )

with the lag of the motors and an unknown gain g. Both sides pass the same band-pass, which removes
what integrators, couplings and noise add. For roll and for pitch, and for each T of a number of
control periods, the sums of a least-squares fit of g are kept, with exponential forgetting. The
delay is the T of the best fit, between the periods by a parabola. T contains the way of the
setpoint to the autopilot, half a period for which it is held, and the latency of the gyro at the
companion.

Anything else that turns the vehicle spoils the fit: the arm, a contact, a payload, gusts. An
oscillation of the arm passes through the law into the setpoint, and then fits a T at which it is
in phase. So an axis has a value only if

- there is enough acceleration, and the fit explains EXPLAINED of it,
- g is one of a rate loop: GAIN / lag. A faster loop has no damping, a slower one does not control,
- no other T far from the best one explains as much: UNIQUE.

The delay is the mean of both axes, weighted by their ratio of explained to unexplained variance. It
is unknown if they contradict each other. A loop that begins to oscillate makes the delay known.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import jit, prepared

DELAYS = 31  # T of 0 to 30 periods, 120 ms at 250 Hz
LOW, HIGH = 1.0, 10.0  # [Hz] corners of the band-pass; two low-passes: propellers shake the gyro
MEMORY = 2.0  # [s] time constant of forgetting
ENOUGH = 1.0  # [s] of flight before the first value
EXPLAINED = 0.5  # share of the variance
STILL = 0.15  # [rad/s^2] RMS below which there is no value
GAIN = (0.1, 1.0)  # g times the lag: least, largest
UNIQUE = 0.6  # of the best fit's explained variance: the most that another maximum may explain
APART, SHARE_APART = 0.012, 0.25  # [s], of their mean: largest difference of the axes, the larger
LEAST_WEIGHT = MEMORY * (1.0 - math.exp(-ENOUGH / MEMORY))  # [s] of that flight
AXES = 2  # roll and pitch; yaw responds too slowly

# rows of the filters' state, per axis
SETPOINT, RATE, LAST = 0, 1, 2  # lagged setpoint, lagged rate, last rate
BAND = 3  # of setpoint, rate, acceleration: two low-passes and a high-pass each
STAGES = 3
_ROWS = BAND + 3 * STAGES
# rows of the sums, per axis
WITH, OWN = 0, 1  # sum of product with the acceleration, sum of squares; per delay


class DelaySums(NamedTuple):
    """Numbers and state of a LoopDelay.

    keep (3,): decay over a period of motor lag, high-pass, low-pass; filters (12, 2); past
    (2, DELAYS): setpoints; sums (2, 2, DELAYS); total (3,): sums of the squared accelerations, of
    the weights.
    """

    keep: np.ndarray
    filters: np.ndarray
    past: np.ndarray
    sums: np.ndarray
    total: np.ndarray


class LoopDelay:
    """Measures the delay of the attitude loop. `value` [s]: NaN while unknown.

    `explained`: share of the variance that the better axis' fit explains, 0 before.
    """

    def __init__(self, motor_lag: float, period: float) -> None:
        """motor_lag [s]: of the rotors' speed; period [s]: of the control ticks."""
        self._keep = np.exp(
            -np.array([period / motor_lag, *(2.0 * math.pi * f * period for f in (LOW, HIGH))])
        )
        self._forget = math.exp(-period / MEMORY)
        self._period = period
        self._gains = (GAIN[0] / motor_lag, GAIN[1] / motor_lag)
        self._filters = np.zeros((_ROWS, AXES))
        self._past = np.zeros((AXES, DELAYS))
        self._sums = np.zeros((AXES, 2, DELAYS))
        self._total = np.zeros(AXES + 1)  # sums of the squared accelerations, of the weights
        self._arrays = DelaySums(self._keep, self._filters, self._past, self._sums, self._total)
        self._follow = prepared(
            follow, self._keep, self._keep, 1.0, 1.0, 0, self._arrays, self._gains
        )
        self._newest = 0
        self._stamp: float | None = None
        self._settling = 0
        self.value, self.explained = math.nan, 0.0

    def update(self, stamp: float, setpoint: np.ndarray, rates: np.ndarray) -> float:
        """Take a tick and return `value`.

        stamp [s]; setpoint (3,), rates (3,) [rad/s, FLU]: sent at the tick, measured at the tick.
        After a gap the filters settle first.
        """
        last, self._stamp = self._stamp, stamp
        if last is None or not 0.5 < (stamp - last) / self._period < 1.5:
            self._filters[:] = self._past[:] = 0.0
            self._filters[SETPOINT], self._filters[RATE] = setpoint[:AXES], rates[:AXES]
            self._filters[LAST] = rates[:AXES]
            self._settling = DELAYS
        self._newest = (self._newest + 1) % DELAYS
        counts = self._settling <= 0
        self._settling -= 1
        forget = self._forget if counts else -1.0
        delay, self.explained, weights = self._follow(
            setpoint, rates, self._period, forget, self._newest, self._arrays, self._gains
        )
        self.value = delay if weights * self._period >= LEAST_WEIGHT else math.nan
        return self.value

    def pause(self) -> None:
        """Take no tick: no setpoint from the laws was sent. The value is unknown."""
        self._stamp, self.value = None, math.nan


@jit
def follow(
    setpoint: np.ndarray,
    rates: np.ndarray,
    period: float,
    forget: float,
    newest: int,
    arrays: DelaySums,
    gains: tuple[float, float],
) -> tuple[float, float, float]:
    """Take a tick; return delay [s], explained share, and the sum of the weights of all ticks.

    The arguments are those of `advance` and `both_axes`.
    """
    advance(setpoint, rates, period, forget, newest, arrays)
    delay, explained = both_axes(arrays.sums, arrays.total, gains, period)
    return delay, explained, arrays.total[AXES]


@jit
def advance(
    setpoint: np.ndarray,
    rates: np.ndarray,
    period: float,
    forget: float,
    newest: int,
    arrays: DelaySums,
) -> None:
    """Advance the filters by a tick, and the sums unless forget is negative.

    setpoint, rates (3,) [rad/s]; forget: decay of the sums over a period [s]; newest: column of
    `past` for this tick's setpoint.
    """
    keep, filters, past, sums, total = arrays
    passed = np.empty(3)
    for axis in range(past.shape[0]):
        acceleration = (rates[axis] - filters[LAST, axis]) / period
        filters[LAST, axis] = rates[axis]
        for row in (SETPOINT, RATE):
            value = setpoint[axis] if row == SETPOINT else rates[axis]
            filters[row, axis] = keep[0] * filters[row, axis] + (1.0 - keep[0]) * value
        for i in range(3):
            value = acceleration if i == 2 else filters[i, axis]
            for stage in range(STAGES):
                row, rest = BAND + STAGES * i + stage, keep[1] if stage == STAGES - 1 else keep[2]
                filters[row, axis] = rest * filters[row, axis] + (1.0 - rest) * value
                if stage == STAGES - 1:
                    passed[i] = value - filters[row, axis]
                value = filters[row, axis]
        past[axis, newest] = passed[SETPOINT]
        if forget < 0.0:
            continue
        for delay in range(past.shape[1]):
            error = past[axis, (newest - delay) % past.shape[1]] - passed[RATE]
            sums[axis, WITH, delay] = forget * sums[axis, WITH, delay] + error * passed[2]
            sums[axis, OWN, delay] = forget * sums[axis, OWN, delay] + error * error
        total[axis] = forget * total[axis] + passed[2] * passed[2]
    if forget >= 0.0:
        total[-1] = forget * total[-1] + 1.0


@jit
def both_axes(
    sums: np.ndarray, total: np.ndarray, gains: tuple[float, float], period: float
) -> tuple[float, float]:
    """Return the delay [s], NaN if unknown, and the explained share of the better axis.

    sums (2, 2, DELAYS), total (3,): see LoopDelay; gains [1/s]: least, largest; period [s].
    """
    least = largest = math.nan
    weighted = weights = better = 0.0
    for axis in range(sums.shape[0]):
        moved = total[axis] >= STILL**2 * total[-1] and total[axis] > 0.0
        delay, explained = best(sums[axis], total[axis], gains)
        better = max(better, explained)
        if not moved or math.isnan(delay):
            continue
        delay *= period
        least, largest = (
            (delay, delay) if math.isnan(least) else (min(least, delay), max(largest, delay))
        )
        weight = explained / max(1.0 - explained, 1e-6)
        weighted, weights = weighted + weight * delay, weights + weight
    if weights == 0.0:
        return math.nan, better
    mean = weighted / weights
    if largest - least > max(APART, SHARE_APART * mean):
        return math.nan, better
    return mean, better


@jit
def best(sums: np.ndarray, total: float, gains: tuple[float, float]) -> tuple[float, float]:
    """Return the delay [periods] of an axis' best fit, and the share of variance it explains.

    NaN for a delay that is not certain: see the first lines. sums (2, DELAYS); total: the sum of
    the squared accelerations; gains [1/s]: least, largest.
    """
    count = sums.shape[1]
    explained = np.zeros(count)
    if total <= 0.0:
        return math.nan, 0.0
    for delay in range(count):
        own, product = sums[OWN, delay], sums[WITH, delay]
        if own > 0.0 and product > 0.0:  # the gain is positive
            explained[delay] = product * product / (own * total)
    at = int(np.argmax(explained))
    top = explained[at]
    other = 0.0  # the largest of the other maxima
    for delay in range(count):
        before = explained[delay - 1] if delay > 0 else -1.0
        after = explained[delay + 1] if delay < count - 1 else -1.0
        if delay != at and explained[delay] >= before and explained[delay] >= after:
            other = max(other, explained[delay])
    gain = sums[WITH, at] / sums[OWN, at] if sums[OWN, at] > 0.0 else 0.0
    certain = top >= EXPLAINED and gains[0] <= gain <= gains[1] and other <= UNIQUE * top
    if not certain:
        return math.nan, top
    if at == 0 or at == count - 1:
        return float(at), top
    before, after = explained[at - 1], explained[at + 1]
    curvature = before - 2.0 * top + after
    return at + (0.5 * (before - after) / curvature if curvature < 0.0 else 0.0), top
