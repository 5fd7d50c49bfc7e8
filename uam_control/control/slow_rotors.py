"""What the position law does about its rotors: a lead for their lag, and the thrust of lift-off.

Lead. A thrust f follows its command c as lag f' = c - f. With

    c = f + lag / response (u - f)

it follows the law's force u as response f' = u - f. f is modelled from the commands as they were
limited, so that a limit leaves no error behind. All of the force is scaled, so that its direction,
the desired attitude, stays.

Lift-off. On the ground nothing tells how much thrust lifts the vehicle: its mass, battery and
rotors differ from the files. theta_hat takes what is missing from the position's error, and until
then the vehicle stays behind. So from SPUN_UP lags after the law's begin on, theta_hat grows by
`lift_rate` until the vehicle climbs. What the rotors had not made yet is then taken back.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.coordinates import X, Z
from uam_control.maths.compiled import borrowing

SPUN_UP = 3.0  # lags after which the rotors have 95 % of the first thrust
CLIMBS = 0.03  # [m/s] speed of a vehicle that has left the ground


class SlowRotors(NamedTuple):
    """lag, response [s]: see above, no lead for a response of 0; rate [m/s^3]: of theta_hat before
    the lift-off, 0 = none, most [m/s^2]: of it; thrust (1,) [N]: f, NaN at first; memory (1,): see
    MEMORY."""

    lag: float
    response: float
    rate: float
    most: float
    thrust: np.ndarray
    memory: np.ndarray


MEMORY = "grounded", "waited grown"  # whether it has not lifted off; [s] since the begin; [m/s^2]


@borrowing
def lead_force(s: SlowRotors, least: float, largest: float, dt: float, tau: np.ndarray) -> bool:
    """Scale the force tau (3,) [N], in place, for rotors that lag; return whether a limit acted.

    least [N]: smallest tau[Z] > 0; largest [N]: of ||tau||; dt [s].
    """
    if s.response <= 0.0:
        return False
    made = s.thrust[0]
    if math.isnan(made):
        made = tau[Z]
    wanted = made + s.lag / s.response * (tau[Z] - made)
    length = math.sqrt(tau[0] * tau[0] + tau[1] * tau[1] + tau[2] * tau[2])
    given = max(least, min(wanted, tau[Z] * largest / length))
    scale = given / tau[Z]
    for i in range(X, Z + 1):
        tau[i] *= scale
    s.thrust[0] = made + (1.0 - math.exp(-dt / s.lag)) * (given - made)
    return given != wanted


@borrowing
def lift_off(s: SlowRotors, climb: float, dt: float, bias: np.ndarray) -> None:
    """Let bias (3,) [m/s^2] find the thrust that lifts a vehicle off, in place.

    climb [m/s]: speed upwards; dt [s]. A negative bias lifts. The thrust that lifted was commanded
    a lag earlier, and the speed CLIMBS took sqrt(2 climb / rate) more.
    """
    m = s.memory[0]
    if m.grounded == 0:
        return
    m.waited += dt
    if climb > CLIMBS:
        m.grounded = 0
        bias[Z] += min(m.grown, s.rate * (s.lag + math.sqrt(2.0 * climb / s.rate)))
    elif m.waited > SPUN_UP * s.lag and m.grown < s.most:
        m.grown += s.rate * dt
        bias[Z] -= s.rate * dt
