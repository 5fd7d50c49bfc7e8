"""Margins of an open loop from its frequency response: gain, phase, delay, bandwidth.

The open loop L is that of negative feedback: the closed loop is stable up to 1 + L = 0. Crossings
are interpolated between the frequencies.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

TINY = 1e-30  # of a loop or an eigenvalue: one that acts on nothing is 0


@dataclass(frozen=True)
class Margins:
    """Margins of one loop; inf or NaN where the loop has no such crossing.

    crossover [rad/s]: highest frequency with |L| = 1. phase [deg]: smallest phase margin. gain
    [dB]: by which the gain may grow; gain_down [dB]: by which it may fall. delay [s]: that may be
    added. bandwidth [Hz]: highest frequency at which |L / (1 + L)| falls below -3 dB. peak: largest
    |1 / (1 + L)|.
    """

    crossover: float
    phase: float
    gain: float
    gain_down: float
    delay: float
    bandwidth: float
    peak: float


def margins(omega: np.ndarray, loop: np.ndarray) -> Margins:
    """Return the margins of L (k,), complex, at the ascending frequencies omega (k,) [rad/s]."""
    size, angle = np.log(np.maximum(np.abs(loop), TINY)), np.unwrap(np.angle(loop))
    phases, delays, at = [], [], math.nan
    for i, share in _crossings(size):
        at = _between(np.log(omega), i, share)
        at, phase = math.exp(at), _between(angle, i, share)
        left = math.remainder(phase + math.pi, 2.0 * math.pi)  # of the phase above -180 deg
        phases.append(math.degrees(left))
        delays.append((left % (2.0 * math.pi)) / at)
    gains = []
    turned = (angle + math.pi) / (2.0 * math.pi)  # whole numbers: phase of -180 deg
    for whole in range(math.ceil(turned.min()), math.floor(turned.max()) + 1):
        gains += [-_between(size, i, share) for i, share in _crossings(turned - whole)]
    decibel = 20.0 / math.log(10.0)
    closed = np.log(np.maximum(np.abs(loop / (1.0 + loop)), TINY)) + 0.5 * math.log(2.0)
    ends = [math.exp(_between(np.log(omega), i, s)) for i, s in _crossings(closed)]
    return Margins(
        crossover=at,
        phase=min(phases, key=abs, default=math.inf),
        gain=decibel * min((gain for gain in gains if gain > 0.0), default=math.inf),
        gain_down=decibel * -max((gain for gain in gains if gain < 0.0), default=-math.inf),
        delay=min(delays, default=math.inf),
        bandwidth=ends[-1] / (2.0 * math.pi) if ends else math.nan,
        peak=float(np.max(1.0 / np.abs(1.0 + loop))),
    )


def common_delay(omega: np.ndarray, loops: np.ndarray) -> float:
    """Return the delay margin [s] of several signals that are delayed together.

    loops (k, m, m): return matrices at omega (k,) [rad/s], negative feedback. The closed loop is at
    its limit where an eigenvalue of L exp(-j omega T) is -1.
    """
    values = np.linalg.eigvals(loops)
    # one frequency to the next: the eigenvalues in the order that moves them least
    for k in range(1, len(values)):
        distance = np.abs(values[k - 1][:, None] - values[k][None, :])
        order = np.empty(len(values[k]), dtype=int)
        for _ in range(len(order)):
            i, j = np.unravel_index(np.argmin(distance), distance.shape)
            order[i] = j
            distance[i, :] = distance[:, j] = np.inf
        values[k] = values[k][order]
    found = [math.inf]
    for column in values.T:
        size, angle = np.log(np.maximum(np.abs(column), TINY)), np.unwrap(np.angle(column))
        for i, share in _crossings(size):
            at = math.exp(_between(np.log(omega), i, share))
            found.append(((_between(angle, i, share) + math.pi) % (2.0 * math.pi)) / at)
    return min(found)


def _crossings(values: np.ndarray) -> list[tuple[int, float]]:
    """Return each zero of values (k,): index before it, and the share of the step up to it."""
    before, after = values[:-1], values[1:]
    found = np.flatnonzero((before > 0.0) != (after > 0.0))
    return [(int(i), float(before[i] / (before[i] - after[i]))) for i in found]


def _between(values: np.ndarray, i: int, share: float) -> float:
    return float(values[i] + share * (values[i + 1] - values[i]))
