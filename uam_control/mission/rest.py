"""How long the way from a motion to rest takes, within the limits of the mission.

A motion is (5, 6 + n): chi with its rates, accelerations, jerk and snap.
"""

import math

import numpy as np

from uam_control.coordinates import ARM, CHI, CHI_DOT, POSITION, YAW
from uam_control.mission.mission_parameters import MissionParameters
from uam_control.mission.motion.segments import WayBack
from uam_control.mission.plans import PEAK, RAMP


def ramp(
    motion: np.ndarray,
    p: MissionParameters,
    shortest: float = math.inf,
    acceleration: float | None = None,
) -> float:
    """Return the time [s] to stop from a motion within stop_acceleration.

    shortest [s]: in place of a longer stop_time; acceleration [m/s^2]: of stop_acceleration.
    """
    speed = float(np.linalg.norm(motion[CHI_DOT, POSITION]))
    return max(min(shortest, p.stop_time), RAMP * speed / (acceleration or p.stop_acceleration))


def goal(
    motion: np.ndarray, acceleration: float, p: MissionParameters, stowed: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return goal and duration [s] (6 + n) of each coordinate to rest within `acceleration`.

    stowed (n,) [rad]: where the arm goes, None: it stops on its way.
    """
    speed = float(np.linalg.norm(motion[CHI_DOT, POSITION]))
    length = max(p.stop_time, 2.0 * RAMP * speed / acceleration)
    end = motion[CHI] + motion[CHI_DOT] * length / 2
    lengths = np.full_like(motion[CHI], length)
    if stowed is not None:
        end[ARM] = stowed
        lengths[ARM] = arm_length(motion, stowed, p)
    return end, lengths


def arm_length(motion: np.ndarray, angles: np.ndarray, p: MissionParameters) -> float:
    """Return the time [s] for the arm to reach `angles` [rad] within stow_rate.

    A joint that moves away from them first stops. Its way back is longer by rate * time / 2,
    and at the peak of the way back, midway, half of the rate away is left.
    """
    way = angles - motion[CHI, ARM]
    away = np.clip(-np.sign(way) * motion[CHI_DOT, ARM], 0.0, p.stow_rate)
    back = np.abs(way) + away * p.stop_time / 2
    peak = p.stow_rate - (PEAK - 1.0) / 2.0 * away
    return max(p.stop_time, PEAK * float(np.max(back / peak)))


def way_back(stamp: float, offset: np.ndarray, p: MissionParameters) -> WayBack:
    """Return the decay to zero of an offset (5, 6 + n) from the path, from `stamp` [s] on."""
    way, speed = (float(np.linalg.norm(offset[row, POSITION])) for row in (CHI, CHI_DOT))
    length = max(
        p.stop_time,
        WayBack.PEAK * way / p.travel_speed,
        math.sqrt(WayBack.HARDEST * way / p.stop_acceleration),
        2.0 * RAMP * speed / p.stop_acceleration,
        WayBack.PEAK * abs(float(offset[CHI, YAW])) / p.turn_rate,
    )
    return WayBack(stamp, offset, length)
