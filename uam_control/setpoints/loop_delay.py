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

import math
from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing, jit, prepared

LONGEST = 0.12  # [s] largest T
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
# entries of `now`: stamp [s] of the last tick (NaN: none), column of `past` for its setpoint, ticks
# for which the filters settle
STAMP, NEWEST, SETTLING = range(3)


class DelayNumbers(NamedTuple):
    """Numbers of a LoopDelay."""

    period: float  # [s]
    forget: float  # decay of the sums over a period
    least: float  # [1/s] gain of a rate loop
    largest: float  # [1/s]
    lag: float  # decay over a period of the motor lag
    low: float  # decay over a period with the corner LOW
    high: float  # with the corner HIGH


class DelaySums(NamedTuple):
    """State of a LoopDelay."""

    now: np.ndarray  # (3,) STAMP..SETTLING
    filters: np.ndarray  # (12, 2)
    past: np.ndarray  # (2, delays) setpoints
    sums: np.ndarray  # (2, 2, delays)
    total: np.ndarray  # (3,) sums of the squared accelerations, of the weights


class LoopDelay:
    """Measures the delay of the attitude loop; the fit is made when a value is asked for."""

    def __init__(self, motor_lag: float, period: float) -> None:
        """motor_lag [s]: of the rotors' speed; period [s]: of the control ticks."""
        keep = np.exp(
            -np.array([period / motor_lag, *(2.0 * math.pi * f * period for f in (LOW, HIGH))])
        )
        gains = GAIN[0] / motor_lag, GAIN[1] / motor_lag
        self.numbers = DelayNumbers(
            float(period), math.exp(-period / MEMORY), *gains, *keep.tolist()
        )
        delays = round(LONGEST / period) + 1
        self.sums = DelaySums(
            np.array([math.nan, 0.0, 0.0]),
            np.zeros((_ROWS, AXES)),
            np.zeros((AXES, delays)),
            np.zeros((AXES, 2, delays)),
            np.zeros(AXES + 1),
        )
        self._both_axes = prepared(both_axes, self.sums.sums, self.sums.total, self.numbers)

    @property
    def value(self) -> float:
        """The delay [s], NaN while unknown."""
        weight = self.sums.total.item(AXES) * self.numbers.period
        if math.isnan(self.sums.now.item(STAMP)) or weight < LEAST_WEIGHT:
            return math.nan
        return self._fit()[0]

    @property
    def explained(self) -> float:
        """Share of the variance that the better axis' fit explains, 0 before."""
        return self._fit()[1]

    def _fit(self) -> tuple[float, float]:
        return self._both_axes(self.sums.sums, self.sums.total, self.numbers)


@borrowing
def pause(state: DelaySums) -> None:
    """Take no tick, as the laws have sent no setpoint: the delay is unknown."""
    state.now[STAMP] = math.nan


@borrowing
def follow(
    stamp: float,
    setpoint: np.ndarray,
    rates: np.ndarray,
    state: DelaySums,
    numbers: DelayNumbers,
) -> None:
    """Take a tick: advance the state.

    stamp [s]; setpoint (3,), rates (3,) [rad/s, FLU]: sent at the tick, measured at the tick.
    After a gap the filters settle first.
    """
    now, filters, past = state.now, state.filters, state.past
    period = numbers.period
    # false for the NaN of no last tick, too
    if not 0.5 < (stamp - now[STAMP]) / period < 1.5:
        filters[:] = 0.0
        past[:] = 0.0
        for axis in range(AXES):
            filters[SETPOINT, axis] = setpoint[axis]
            filters[RATE, axis] = filters[LAST, axis] = rates[axis]
        now[SETTLING] = past.shape[1]
    now[STAMP] = stamp
    now[NEWEST] = (now[NEWEST] + 1.0) % past.shape[1]
    counts = now[SETTLING] <= 0.0
    now[SETTLING] -= 1.0
    advance(setpoint, rates, counts, state, numbers)


@jit
def advance(
    setpoint: np.ndarray,
    rates: np.ndarray,
    counts: bool,
    state: DelaySums,
    numbers: DelayNumbers,
) -> None:
    """Advance the filters by a tick, and the sums if it counts; setpoint, rates (3,) [rad/s]."""
    now, filters, past, sums, total = state
    period, forget, newest = numbers.period, numbers.forget, int(now[NEWEST])
    count = past.shape[1]
    passed = np.empty(3)
    for axis in range(past.shape[0]):
        acceleration = (rates[axis] - filters[LAST, axis]) / period
        filters[LAST, axis] = rates[axis]
        for row in (SETPOINT, RATE):
            value = setpoint[axis] if row == SETPOINT else rates[axis]
            filters[row, axis] = numbers.lag * filters[row, axis] + (1.0 - numbers.lag) * value
        for i in range(3):
            value = acceleration if i == 2 else filters[i, axis]
            for stage in range(STAGES):
                row = BAND + STAGES * i + stage
                rest = numbers.low if stage == STAGES - 1 else numbers.high
                filters[row, axis] = rest * filters[row, axis] + (1.0 - rest) * value
                if stage == STAGES - 1:
                    passed[i] = value - filters[row, axis]
                value = filters[row, axis]
        past[axis, newest] = passed[SETPOINT]
        if not counts:
            continue
        for delay in range(count):
            before = newest - delay
            error = past[axis, before if before >= 0 else before + count] - passed[RATE]
            sums[axis, WITH, delay] = forget * sums[axis, WITH, delay] + error * passed[2]
            sums[axis, OWN, delay] = forget * sums[axis, OWN, delay] + error * error
        total[axis] = forget * total[axis] + passed[2] * passed[2]
    if counts:
        total[-1] = forget * total[-1] + 1.0


@borrowing
def both_axes(sums: np.ndarray, total: np.ndarray, numbers: DelayNumbers) -> tuple[float, float]:
    """Return the delay [s], NaN if unknown, and the explained share of the better axis.

    sums (2, 2, delays), total (3,): see LoopDelay.
    """
    gains, period = (numbers.least, numbers.largest), numbers.period
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

    NaN for a delay that is not certain: see the first lines. sums (2, delays); total: the sum of
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
