"""A lead for rotors that lag: the thrust follows the position law's force faster than they do.

The thrust f follows its command c as lag f' = c - f. With

    c = f + lag / response (u - f)

it follows the force u as response f' = u - f. f is modelled from the commands as they were limited,
so that a limit leaves no error behind. All of the force is scaled, so that its direction stays, and
with it the desired attitude.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.coordinates import X, Z
from uam_control.maths.compiled import borrowing


class RotorLead(NamedTuple):
    """lag, response [s]: see above; no lead for a response of 0. made (1,) [N]: upward part of f,
    NaN at first: then it is u."""

    lag: float
    response: float
    made: np.ndarray


@borrowing
def lead_force(lead: RotorLead, least: float, largest: float, dt: float, tau: np.ndarray) -> bool:
    """Scale the force tau (3,) [N, ENU] by the lead, in place; return whether a limit acted.

    least [N], above 0: smallest tau[Z], which tau has, too; largest [N]: of ||tau||; dt [s].
    """
    if lead.response <= 0.0:
        return False
    upward, made = tau[Z], lead.made[0]
    if math.isnan(made):
        made = upward
    length = math.sqrt(tau[0] * tau[0] + tau[1] * tau[1] + tau[2] * tau[2])
    wanted = made + lead.lag / lead.response * (upward - made)
    given = max(least, min(wanted, upward * largest / length))
    for i in range(X, Z + 1):
        tau[i] *= given / upward
    lead.made[0] = made + (1.0 - math.exp(-dt / lead.lag)) * (given - made)
    return given != wanted
