"""Braking: a reference that begins in the vehicle's present motion and comes to rest.

Each group of coordinates is the sum of two polynomials of time. The fade takes the acceleration and
the jerk of the start to zero: its acceleration is a quintic. The brake takes the rate that is left
to zero: its rate is a septic. Both have the least degree for which value, rate, acceleration, jerk
and snap are continuous between the parts and at rest, and the snap is zero at the start: the snap
is the angular acceleration of the body, so the torque has no step.
"""

import math

import numpy as np

from uam_control.coordinates import ALPHA, ATTITUDE, CHI, CHI_DDOT, CHI_DOT, POSITION, YAW, X, Y, Z
from uam_control.maths.rotations import matrix_from_euler
from uam_control.mission.mission_parameters import MissionParameters
from uam_control.mission.motion.polynomials import Polynomials

PLACES = 20  # on the way to rest, for the check of the geofence
SHORTEST = 0.3  # [s] of a fade, and of the stop of a sinking vehicle near the ground
MOST_ACROSS, MOST_UP = 7.0, 3.0  # [m/s^2] largest acceleration at the start: 35 deg of tilt, 0.3 g
ACROSS = slice(X, Z)
# The fade's jerk keeps half of the bound for any jerk at the start up to it: sup over s of
# 30 s^2 (1 - s)^2 |a| / (T J) + |(1 - s)^2 (1 + 2 s - 15 s^2)| is 1 for T = 3.6465 |a| / J.
_FADE = 3.6465
_PEAK, _STEEPEST = 2.1875, 7.5133  # of the brake's septic: acceleration T / v and jerk T^2 / v
# A brake at least this much longer than the fade grows more slowly than the fade decays, so their
# sum stays below the larger of the two accelerations.
_LONGER = 2.5


class Stop:
    """Motion of k coordinates from value, rate, acceleration and jerk to rest.

    The norm of the jerk stays within `jerk`; that of the acceleration within `acceleration`, or
    within that of the start plus 0.2 of the jerk's run-out, where this is larger. `length` [s].
    """

    def __init__(
        self, start: np.ndarray, acceleration: float, jerk: float, shorter: float = 1.0
    ) -> None:
        """start (4, k): value .. jerk [SI]; a jerk beyond half of the bound is cut to it.

        acceleration [1/s^2], jerk [1/s^3]: bounds; shorter: factor on the duration, below 1 the
        bounds are exceeded.
        """
        value, rate, a, j = start
        share = jerk / 2.0
        j = j * min(1.0, share / max(float(np.linalg.norm(j)), 1e-9))
        fade = shorter * max(SHORTEST, _FADE * float(np.linalg.norm(a)) / share)
        gained = fade * (a / 2.0 + j * fade / 10.0)  # rate at the end of the fade
        speed = float(np.linalg.norm(rate + gained))
        quick = max(_PEAK * speed / acceleration, math.sqrt(_STEEPEST * speed / share))
        brake = max(shorter * quick, _LONGER * fade)
        zero, a, j = np.zeros_like(value), a * fade**2, j * fade**3
        faded = [zero, -a / 2 - 0.3 * j, a / 2 + j * (4 / 15), -a / 7 - j / 14]
        first = [zero, -gained * fade, a / 2, j / 6, *faded]
        v = (rate + gained) * brake
        second = [value, v, zero, zero, zero, -7.0 * v, 14.0 * v, -10.0 * v, 2.5 * v]
        ends = (first, fade), (second, brake)
        self._parts = [Polynomials([0.0, end], np.array([powers])) for powers, end in ends]
        self.length = brake

    def at(self, time: float) -> np.ndarray:
        """Return value, rate, acceleration, jerk and snap (5, k) at `time` [s] from the start."""
        if time <= 0.0:
            return sum(part.ends()[0] for part in self._parts)
        return sum(part.rows([time])[:, 0] for part in self._parts)

    def values(self, times: np.ndarray) -> np.ndarray:
        """Return the values (m, k) at times (m,) [s] from the start."""
        return sum(part.rows(times, 1)[CHI] for part in self._parts)


class Braking:
    """The base's reference from the vehicle's present motion to rest; `end` [s]: stamp of it.

    The horizontal motion, the vertical motion and the yaw have their own durations.
    """

    def __init__(self, stamp: float, state: np.ndarray, p: MissionParameters, ground: float):
        """Begin at `stamp` [s] from `state` (3, 6 + n) of that time; ground: its height [m].

        A vehicle that sinks loses at most half of its height above ground, unless this takes less
        than 0.3 s; the bounds give way to this.
        """
        self._stamp = stamp
        start = present_motion(state, p.gravity)
        bounds = p.brake_acceleration, p.brake_jerk
        low = ground + max(0.0, float(state[CHI, Z]) - ground) / 2.0
        yaw_bounds = p.brake_yaw_acceleration, p.brake_yaw_jerk
        self._stops = (
            (ACROSS, Stop(start[:, ACROSS], *bounds)),
            (slice(Z, Z + 1), _above(low, start[:, Z : Z + 1], *bounds)),
            (slice(YAW, YAW + 1), Stop(start[:, YAW : YAW + 1], *yaw_bounds)),
        )
        self.end = stamp + max(stop.length for _, stop in self._stops)

    def places(self) -> np.ndarray:
        """Return positions [m] (m, 3) on the way to rest, the first and the last included."""
        times = np.linspace(0.0, self.end - self._stamp, PLACES)
        return np.hstack([stop.values(times) for _, stop in self._stops[:2]])

    def write(self, stamp: float, reference: np.ndarray) -> None:
        """Write the base's columns of reference (3 to 5, 6 + n): its derivatives at `stamp` [s]."""
        reference[:, :ALPHA] = 0.0
        for columns, stop in self._stops:
            reference[:, columns] = stop.at(stamp - self._stamp)[: len(reference)]


def leaves_geofence(stamp: float, state: np.ndarray, p: MissionParameters, ground: float) -> str:
    """Say by how much a vehicle that brakes, see `Braking`, would leave the geofence, or ""."""
    places = Braking(stamp, state, p, ground).places()
    low, high = np.array(p.geofence_low), np.array(p.geofence_high)
    beyond = np.maximum(low - places, places - high).max(axis=0)
    axis = int(np.argmax(beyond))
    if beyond[axis] <= 0.0:
        return ""
    return (
        f"the vehicle would leave the geofence by {beyond[axis]:.1f} m in {'xyz'[axis]} before "
        "it stops: slow down, or fly back first"
    )


def present_motion(state: np.ndarray, gravity: float) -> np.ndarray:
    """Return value, rate, acceleration and jerk (4, 6) of position and yaw of state (3, 6 + n).

    gravity [m/s^2].

    The acceleration is that of the present thrust in the direction of the present thrust axis, the
    jerk that of the present body rates. A law that follows them begins with the present attitude,
    rates and thrust, as nearly as MOST_ACROSS and MOST_UP allow. A derivative that is not finite
    counts as zero.
    """
    motion = np.zeros((4, ALPHA))
    motion[CHI] = state[CHI, :ALPHA]
    motion[CHI, ATTITUDE] = 0.0, 0.0, state[CHI, YAW]
    moving = np.nan_to_num(state[CHI_DOT:, :ALPHA], nan=0.0, posinf=0.0, neginf=0.0)
    roll, pitch, yaw = np.nan_to_num(state[CHI, ATTITUDE])
    rotation = matrix_from_euler(np.array([roll, pitch, yaw]))
    axis, about = rotation[:, Z], moving[0, ATTITUDE]
    up = np.array([0.0, 0.0, gravity])
    lift = float((moving[1, POSITION] + up) @ axis)
    acceleration = lift * axis - up
    across = float(np.hypot(acceleration[X], acceleration[Y]))
    acceleration[ACROSS] *= min(1.0, MOST_ACROSS / max(across, MOST_ACROSS))
    acceleration[Z] = min(MOST_UP, max(-MOST_UP, acceleration[Z]))
    motion[CHI_DOT, POSITION], motion[CHI_DDOT, POSITION] = moving[0, POSITION], acceleration
    motion[3, POSITION] = lift * (about[Y] * rotation[:, X] - about[X] * rotation[:, Y])
    level = max(0.1, math.cos(pitch))
    motion[CHI_DOT, YAW] = (math.sin(roll) * about[Y] + math.cos(roll) * about[Z]) / level
    return motion


def _above(low: float, start: np.ndarray, acceleration: float, jerk: float) -> Stop:
    """Return the stop from start (4, 1) that stays above `low` [m], shortened if necessary."""
    shorter = 1.0
    while True:
        stop = Stop(start, acceleration, jerk, shorter)
        lowest = np.min(stop.values(np.linspace(0.0, stop.length, 20)))
        if stop.length <= SHORTEST or lowest >= low:
            return stop
        shorter *= 0.8
