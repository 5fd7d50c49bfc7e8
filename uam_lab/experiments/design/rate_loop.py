"""Gains of the autopilot's rate loop in closed form, for one axis.

With the inertia J, the torque S of a normalised torque of 1, d = S K D / J, and a lag T of rotor
and dead time, the loop J T s^2 + J (1 + d) s + S K P = 0 has the damping `rate.damping` for

    lambda_2 = S K P / (J (1 + d)) = (1 + d) / (4 damping^2 T)

J (1 + d) = Mbar and lambda_2 are those of the attitude law: Mbar lambda_2 = S K P, so that the
measured body rates cancel in the setpoint (docs/tuning.md). 1 + d is bisected: as large as dead
time, noise and torque allow. Where less than 1 is allowed, d = 0 and the loop is slower.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from uam_lab.experiments.design.facts import Facts

LEAST, STEPS = 1e-3, 40  # of 1 + d, and of its bisection


class RateLoop(NamedTuple):
    """P, I, D of one axis with K = 1; stiffness S K P [N m s/rad]; Mbar [kg m^2]; bandwidth
    lambda_2 [rad/s]; limit: what keeps it from being faster."""

    p: float
    i: float
    d: float
    stiffness: float
    inertia: float
    bandwidth: float
    limit: str


def rate_loop(facts: Facts, axis: int, criteria: SimpleNamespace, share: float) -> RateLoop:
    """Return the loop of an axis; share: of 1 + d that is used."""
    lag, late = facts.lag[axis], facts.dead + facts.slope
    # crossover of the path of D, d / (lag s + 1), where the dead time takes dead_phase
    high = math.sqrt(1.0 + (criteria.rate.dead_phase / late * lag) ** 2) + 1.0
    if reason := _exceeded(facts, axis, criteria, high):
        low, limit = LEAST, reason
        for _ in range(STEPS):
            middle = 0.5 * (low + high)
            if reason := _exceeded(facts, axis, criteria, middle):
                high, limit = middle, reason
            else:
                low = middle
        return _loop(facts, axis, criteria, share * low, limit)
    limit = f"rotor lag {1e3 * facts.lag[axis]:.0f} ms, dead time {1e3 * late:.0f} ms"
    return _loop(facts, axis, criteria, share * high, limit)


def _loop(facts: Facts, axis: int, criteria: SimpleNamespace, sum_: float, limit: str) -> RateLoop:
    """Return the loop with 1 + d = sum_."""
    d = max(sum_ - 1.0, 0.0)
    bandwidth = sum_ / (4.0 * criteria.rate.damping**2 * (facts.lag[axis] + facts.dead))
    inertia = facts.inertia[axis] * (1.0 + d)
    p = inertia * bandwidth / facts.scale[axis]
    return RateLoop(
        *(p, criteria.rate.integral * bandwidth * p, d * facts.inertia[axis] / facts.scale[axis]),
        *(inertia * bandwidth, inertia, bandwidth, limit),
    )


def _exceeded(facts: Facts, axis: int, criteria: SimpleNamespace, sum_: float) -> str:
    """Return the criterion that 1 + d = sum_ does not meet, "" if it meets all."""
    loop = _loop(facts, axis, criteria, sum_, "")
    torque = criteria.authority.torque[axis] * facts.torque[axis]
    error = criteria.saturation.attitude
    if loop.stiffness * criteria.attitude * loop.bandwidth * error > torque:
        return f"torque {torque:.2g} N m"
    gains = np.array([loop.p, loop.d])
    if math.sqrt(gains @ facts.noise[axis] @ gains) > criteria.noise:
        return f"gyroscope noise, {100 * criteria.noise:g} % of the command"
    return ""
