"""Motions from one state to rest, and how long they take within the limits of the mission.

To a goal, or from beside the path back to it. A motion is (5, 6 + n), see `coordinates`.
"""

import math

import numpy as np

from uam_control.coordinates import ARM, CHI, CHI_DOT, JERK, POSITION, SNAP, YAW
from uam_control.mission.mission_parameters import MissionParameters
from uam_control.mission.motion.polynomials import PEAK, RAMP, hermite, quintic, quintic_at


class Segment:
    """Quintic polynomials from a motion to rest at a goal, one duration per coordinate."""

    def __init__(
        self,
        stamp: float,
        start: np.ndarray,
        goal: np.ndarray,
        lengths: np.ndarray,
        columns: slice = slice(None),
    ) -> None:
        """Begin at `stamp` [s] at start (3, 6 + n) or (5, 6 + n); end at goal (6 + n,), after
        lengths (6 + n,) [s]; columns: those that move."""
        self._stamp, self._columns = stamp, columns
        self._lengths, self._goal = lengths[columns], goal[columns].copy()
        start = start[:, columns]
        rest = np.zeros_like(start)
        rest[CHI] = self._goal
        self._powers = quintic(start, rest, self._lengths)

    @property
    def end(self) -> float:
        """Return the stamp [s] at which all coordinates are at rest."""
        return self._stamp + float(np.max(self._lengths))

    def write(self, stamp: float, motion: np.ndarray) -> None:
        """Write the motion (5, 6 + n) at `stamp` [s]."""
        motion = motion[:, self._columns]
        u = np.clip((stamp - self._stamp) / self._lengths, 0.0, 1.0)
        motion[:] = quintic_at(self._powers, u, self._lengths)
        arrived = u >= 1.0  # without rounding errors
        motion[CHI, arrived] = self._goal[arrived]
        motion[CHI_DOT:, arrived] = 0.0


class WayBack:
    """Offset from the path that decays to zero, with no step in value, rate or acceleration.

    From rest the jerk has no step either. PEAK, HARDEST: from rest, largest rate and acceleration,
    times length / way and length^2 / way.
    """

    PEAK, HARDEST = 35.0 / 16.0, 7.5132

    def __init__(self, stamp: float, offset: np.ndarray, p: MissionParameters) -> None:
        """Begin at `stamp` [s] with offset (5, 6 + n); end at rest, within the limits."""
        way, speed = (float(np.linalg.norm(offset[row, POSITION])) for row in (CHI, CHI_DOT))
        length = max(
            p.stop_time,
            WayBack.PEAK * way / p.travel_speed,
            math.sqrt(WayBack.HARDEST * way / p.stop_acceleration),
            2.0 * RAMP * speed / p.stop_acceleration,
            WayBack.PEAK * abs(float(offset[CHI, YAW])) / p.turn_rate,
        )
        rows = np.zeros((SNAP, 2, offset.shape[1]))
        rows[:JERK, 0] = offset[:JERK]  # a jerk at the start would grow with the cube of the length
        self._stamp, self.end = stamp, stamp + length  # [s] end: at which it is zero
        self._curve = hermite(np.array([0.0, length]), rows)

    def write(self, stamp: float, motion: np.ndarray) -> None:
        """Write the offset (5, 6 + n) at `stamp` [s]."""
        self._curve.write(stamp - self._stamp, motion)


def stop_length(
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


def at_rest(
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


def arm_length(
    motion: np.ndarray, angles: np.ndarray, p: MissionParameters, hurry: float = 1.0
) -> float:
    """Return the time [s] for the arm to reach `angles` [rad] within `hurry` times stow_rate.

    A joint that moves away from them first stops. Its way back is longer by rate * time / 2,
    and at the peak of the way back, midway, half of the rate away is left.
    """
    way = angles - motion[CHI, ARM]
    rate = hurry * p.stow_rate
    away = np.clip(-np.sign(way) * motion[CHI_DOT, ARM], 0.0, rate)
    back = np.abs(way) + away * p.stop_time / 2
    peak = rate - (PEAK - 1.0) / 2.0 * away
    return max(p.stop_time, PEAK * float(np.max(back / peak)))
