"""Delay of the attitude loop, measured in flight: from a body-rate setpoint to the gyro's response.

The autopilot's rate loop turns the vehicle with the angular acceleration

    omega_dot(t) = g lag( omega_sp(t - T) - omega(t) )

with the lag of the motors and an unknown gain g. Both sides pass the same band-pass, which removes
what integrators, couplings and noise add. For each T of a number of control periods the sums of a
least-squares fit of g are kept, with exponential forgetting; the delay is the T of the best fit,
between the periods by a parabola. T contains the way of the setpoint to the autopilot, half a
period for which it is held, and the latency of the gyro at the companion.

The vehicle must move for that: the delay is unknown while the fit explains less than EXPLAINED of
the acceleration, or while there is little of it. A loop that begins to oscillate makes it known.
"""

from __future__ import annotations

import math

import numpy as np

from uam_control.maths.compiled import jit

DELAYS = 31  # T of 0 to 30 periods, 120 ms at 250 Hz
LOW, HIGH = 1.0, 10.0  # [Hz] corners of the band-pass
MEMORY = 2.0  # [s] time constant of forgetting
ENOUGH = 1.0  # [s] of flight before the first value
EXPLAINED = 0.5  # share of the variance
STILL = 0.15  # [rad/s^2] RMS below which there is no value
AXES = 2  # roll and pitch; yaw responds too slowly

# rows of the filters' state, per axis
SETPOINT, RATE, LAST = 0, 1, 2  # lagged setpoint, lagged rate, last rate
BAND = 3  # of setpoint, rate, acceleration: low-pass and high-pass state each
_ROWS = BAND + 6
# rows of the sums
WITH, OWN = 0, 1  # sum of product with the acceleration, sum of squares; per delay


class LoopDelay:
    """Measures the delay of the attitude loop. `value` [s]: NaN while unknown.

    `explained`: share of the variance that the best fit explains, 0 before.
    """

    def __init__(self, motor_lag: float, period: float) -> None:
        """motor_lag [s]: of the rotors' speed; period [s]: of the control ticks."""
        self._keep = np.exp(
            -np.array([period / motor_lag, *(2.0 * math.pi * f * period for f in (LOW, HIGH))])
        )
        self._forget = math.exp(-period / MEMORY)
        self._period = period
        self._filters = np.zeros((_ROWS, AXES))
        self._past = np.zeros((AXES, DELAYS))
        self._sums = np.zeros((2, DELAYS))
        self._total = np.zeros(2)  # sum of the squared acceleration, of the weights
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
        follow(
            setpoint, rates, self._period, self._keep, self._forget if counts else -1.0,
            self._newest, self._filters, self._past, self._sums, self._total,
        )  # fmt: skip
        delay, self.explained = best(self._sums, self._total)
        weight = self._total[1]
        good = (
            weight * self._period >= MEMORY * (1.0 - math.exp(-ENOUGH / MEMORY))
            and self.explained >= EXPLAINED
            and self._total[0] >= STILL**2 * weight
        )
        self.value = delay * self._period if good else math.nan
        return self.value

    def pause(self) -> None:
        """Take no tick: no setpoint from the laws was sent. The value is unknown."""
        self._stamp, self.value = None, math.nan


@jit
def follow(
    setpoint: np.ndarray,
    rates: np.ndarray,
    period: float,
    keep: np.ndarray,
    forget: float,
    newest: int,
    filters: np.ndarray,
    past: np.ndarray,
    sums: np.ndarray,
    total: np.ndarray,
) -> None:
    """Advance the filters by a tick, and the sums unless forget is negative.

    keep (3,): decay over a period of motor lag, high-pass, low-pass; forget: of the sums; newest:
    column of past (2, DELAYS) for this tick's setpoint; filters (9, 2), sums (2, DELAYS),
    total (2,): see LoopDelay.
    """
    for axis in range(past.shape[0]):
        acceleration = (rates[axis] - filters[LAST, axis]) / period
        filters[LAST, axis] = rates[axis]
        for row in (SETPOINT, RATE):
            value = setpoint[axis] if row == SETPOINT else rates[axis]
            filters[row, axis] = keep[0] * filters[row, axis] + (1.0 - keep[0]) * value
        passed = np.empty(3)
        for i in range(3):
            value = acceleration if i == 2 else filters[i, axis]
            low, slow = BAND + 2 * i, BAND + 2 * i + 1
            filters[low, axis] = keep[2] * filters[low, axis] + (1.0 - keep[2]) * value
            filters[slow, axis] = (
                keep[1] * filters[slow, axis] + (1.0 - keep[1]) * filters[low, axis]
            )
            passed[i] = filters[low, axis] - filters[slow, axis]
        past[axis, newest] = passed[SETPOINT]
        if forget < 0.0:
            continue
        first = axis == 0
        for delay in range(past.shape[1]):
            error = past[axis, (newest - delay) % past.shape[1]] - passed[RATE]
            if first:
                sums[WITH, delay] *= forget
                sums[OWN, delay] *= forget
            sums[WITH, delay] += error * passed[2]
            sums[OWN, delay] += error * error
        if first:
            total[0] *= forget
            total[1] *= forget
        total[0] += passed[2] * passed[2] / past.shape[0]
        total[1] += 1.0 / past.shape[0]


@jit
def best(sums: np.ndarray, total: np.ndarray) -> tuple[float, float]:
    """Return the delay [periods] of the best fit, and the share of the variance it explains."""
    if total[0] <= 0.0:
        return 0.0, 0.0
    count = sums.shape[1]
    explained = np.zeros(count)
    at = 0
    for delay in range(count):
        own, product = sums[OWN, delay], sums[WITH, delay]
        if own > 0.0 and product > 0.0:  # the gain is positive
            explained[delay] = product * product / (own * total[0] * 2.0)
        if explained[delay] > explained[at]:
            at = delay
    if at == 0 or at == count - 1:
        return float(at), explained[at]
    before, after = explained[at - 1], explained[at + 1]
    curvature = before - 2.0 * explained[at] + after
    return at + (0.5 * (before - after) / curvature if curvature < 0.0 else 0.0), explained[at]
