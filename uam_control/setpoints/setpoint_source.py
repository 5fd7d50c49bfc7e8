"""The setpoint of a tick: from the map, idle, from the level hold, or none.

| commands | sent |
|---|---|
| valid | the setpoint type's part of body rates, attitude and thrust |
| idle (not flying) | rates 0, level, thrust 0: the stream goes on, the vehicle stays landed |
| valid or idle, while somebody else has control | the vehicle's rates, attitude and thrust; \
without commands, or in the air before the first flight, none |
| not finite, malformed or none, on the ground | as idle |
| after a kill | thrust 0; none if the autopilot is not in OFFBOARD |
| after a gap in which the autopilot's failsafe began | none until its reports are new, and on \
the ground none: it lands and disarms |
| the same in flight; the mission in failsafe; idle high above the start | level hold for \
`hold_time` (`release_time` without an estimate; in failsafe `level_time`, after a fast vehicle is \
braked), then no setpoint: the autopilot's failsafe acts |
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from uam_control.ages import STALE
from uam_control.coordinates import ALPHA, ATTITUDE, CHI, CHI_DDOT, CHI_DOT, POSITION, YAW, Z
from uam_control.maths.rotations import euler_from_quaternion, matrix_from_euler
from uam_control.setpoints.level_hold import UNKNOWN, HoldParameters, LevelHold
from uam_control.setpoints.rate_thrust_map import RateThrustMap, SetpointRefused
from uam_control.setpoints.setpoint_types import attitude_setpoint, rates_setpoint
from uam_control.setpoints.targets import STILL, Desired, SetpointType, Target, level

HANDOVER = 0.2  # s after control came back in which the first commands arrive
# [rad/s] largest body rates that are kept for a released vehicle; a pilot yaws faster than it rolls
MOST_RATES = np.array([2.0, 2.0, 3.5])
LEAST_LIFT, MOST_LIFT = 0.5, 1.5  # bounds of its thrust, in parts of the mean thrust
LOW_LIFT = 0.97  # the upper one near the ground: as above, and each hop would ask for more thrust

NO_STREAM = "no stream, OFFBOARD is not possible"

Setpoint = Target | None  # None: no setpoint is sent


def sent(setpoint: Setpoint) -> tuple[np.ndarray, float]:
    """Return body rates (3,) [rad/s, FLU] and thrust 0..1 of a setpoint for the recording.

    NaN for what the setpoint does not contain. Without a setpoint both are zero.
    """
    return (STILL, 0.0) if setpoint is None else (setpoint.body_rates, setpoint.thrust)


class Situation(NamedTuple):
    """State of the autopilot."""

    armed: bool
    landed: bool
    let_go: bool  # the mission requires the autopilot's failsafe
    released: bool = False  # somebody else has control
    followed: bool = True  # it flies the setpoints, in OFFBOARD
    stopped: bool = False  # the motors must stay still
    withheld: bool = False  # its reports may be older than a gap of the stream
    lost: bool = False  # its failsafe acts since such a gap
    disarming: bool = False  # it is asked to disarm


def silent(text: str, key: str | None) -> None:
    """Discard the warning."""


class SetpointSource:
    """Makes the setpoint of a tick from commands, or from the latest state without commands."""

    def __init__(
        self,
        rate_map: RateThrustMap,
        hold: HoldParameters,
        setpoint: SetpointType = rates_setpoint,
        fresh: float = math.inf,
        say: Callable[[str, str | None], None] = silent,
    ) -> None:
        """setpoint: the type that is sent; fresh [s]: age up to which an attitude or a velocity is
        used; say(text, kind): called for each warning."""
        self.map = rate_map
        self.type = setpoint
        self.hold = LevelHold(hold, rate_map.gravity)
        self._margin = hold.ground_margin
        self._fresh_for = fresh
        self._say = say
        self.refused = ""  # why the setpoint of the newest commands was not sent, "" for a good one
        self._estimated = -math.inf  # stamp [s] of the estimate
        self.seen = np.array([-math.inf, *(math.nan,) * 4])  # stamp [s] and quaternion of a pose
        self._motion = np.full((3, ALPHA), math.nan)  # estimate
        self._height = 0.0
        self._ground: float | None = None  # height [m] at which the vehicle stood
        self._present_at = -math.inf  # [s] newest setpoint for a released vehicle

    def note_state(self, stamp: float, state: np.ndarray) -> None:
        """Store the estimate (3, 6 + n), see uam_control.coordinates, of `stamp` [s] uncopied."""
        self._estimated, self._motion, self._height = stamp, state, state.item(CHI, Z)

    def estimate(self, now: float) -> np.ndarray | None:
        """Return the newest estimate (3, 6 + n), None if it is STALE at `now` [s]."""
        return self._motion if now - self._estimated < STALE else None

    def note_pose(self, stamp: float, quaternion: np.ndarray) -> None:
        """Store the attitude (4,) [w x y z], FLU → ENU, of a mocap pose of `stamp` [s]."""
        self.seen[0], self.seen[1:] = stamp, quaternion

    def commanded(
        self,
        now: float,
        state: np.ndarray,
        flying: bool,
        tau_p: np.ndarray,
        tau_q: np.ndarray | None,
        attitude: np.ndarray,
        situation: Situation,
        reference: np.ndarray | None = None,
    ) -> Setpoint:
        """Return the setpoint of a tick with commands.

        now [s]; state (3, 6 + n); flying: whether tau_p (3,) [N, ENU] is valid; tau_q (3,)
        [N m, FLU], None for idle; attitude, reference (3, 3): see `Desired`.
        """
        if situation.let_go or situation.stopped or situation.withheld:
            return self.without(now, situation)
        if situation.released:
            return self._present(now, situation)
        if flying and tau_q is not None:
            try:
                attitude_now, gyro = state[CHI, ATTITUDE], state[CHI_DOT, ATTITUDE]
                rates, thrust = self.map.map(tau_p, tau_q, attitude_now, gyro)
            except SetpointRefused as error:
                self.refused = str(error)
            else:
                torque = self.map.normalised(tau_q, thrust)
                desired = Desired(rates, attitude, thrust, reference, torque)
                setpoint = self.type(desired)
                self.refused = setpoint.refused()
                if not self.refused:
                    self.hold.good(now, desired, attitude_now, situation.followed)
                    return setpoint
            self._say(f"setpoint refused: {self.refused}", None)
        elif not flying and tau_q is None and self._low(now, situation):
            self.hold.reset()
            self.refused = ""
            return self._idle
        return self.without(now, situation)

    def without(self, now: float, situation: Situation) -> Setpoint:
        """Return the setpoint at `now` [s] without valid commands."""
        armed, landed, let_go, released = situation[:4]
        high = self._high(situation)
        if situation.stopped:
            return self._idle if situation.followed else None
        if self._silent(situation):
            return None
        if released and armed and high:
            self._say(f"no usable commands while released: {NO_STREAM}", "hold")
            return None
        if self._handed_over(now):
            return self._at_present(now, situation)
        if not armed or (landed and not high):
            return self._idle
        longest, p = None, self.hold.parameters
        known = self._fresh(self._estimated, now)
        velocity = self._motion[CHI_DOT, POSITION] if known else UNKNOWN
        if let_go:
            longest = p.level_time
        elif not known:
            longest = p.release_time
        desired = self.hold.setpoint(now, self._attitude(now), velocity, longest, let_go)
        doing = "holding level" if desired else "stream stopped, the failsafe acts"
        self._say(f"no usable commands in flight: {doing}", "hold")
        if desired is None:
            return None
        # in a failsafe the setpoints may be late: the autopilot levels the vehicle by itself
        return (attitude_setpoint if let_go else self.type)(desired)

    def _present(self, now: float, situation: Situation) -> Setpoint:
        """Return the setpoint at `now` [s] while somebody else has control.

        When OFFBOARD comes back, the autopilot begins with it: it must be free of a jump.
        """
        if self._silent(situation):
            return None
        if not situation.armed or (situation.landed and not self._high(situation)):
            return self._idle
        if not self.hold.mean_thrust:
            self._say(f"thrust to hover unknown: {NO_STREAM}", "hold")
            return None
        self._present_at = now
        return self._at_present(now, situation)

    def _at_present(self, now: float, situation: Situation) -> Target:
        """Return the setpoint that keeps the present motion: body rates, attitude and thrust.

        The thrust is the mean thrust of the flight so far, times the present acceleration along
        the thrust axis in parts of gravity; low down it does not lift off. After control came back
        the rates decay to zero within HANDOVER: nothing else would stop the rotation if no commands
        came.
        """
        angles, rates, lift = np.zeros((3, 3)), np.zeros(3), 1.0
        angles[0] = np.nan_to_num(self._attitude(now))
        if self._fresh(self._estimated, now) and np.all(np.isfinite(self._motion)):
            part = 1.0 - min(1.0, max(0.0, now - self._present_at) / HANDOVER)
            rates = part * np.clip(self._motion[CHI_DOT, ATTITUDE], -MOST_RATES, MOST_RATES)
            gravity = self.map.gravity
            force = self._motion[CHI_DDOT, POSITION] + np.array([0.0, 0.0, gravity])
            lift = float(force @ matrix_from_euler(angles[0])[:, Z]) / gravity
        most = MOST_LIFT if self._high(situation) else LOW_LIFT
        thrust = self.map.scaled(self.hold.mean_thrust, min(most, max(LEAST_LIFT, lift)))
        return self.type(Desired(rates, angles, thrust))

    @property
    def _idle(self) -> Target:
        yaw = self._motion.item(CHI, YAW)
        return self.type(Desired(np.zeros(3), level(yaw if math.isfinite(yaw) else 0.0), 0.0))

    def _handed_over(self, now: float) -> bool:
        """Whether control came back just before, and the mission may not have resumed yet."""
        return now - self._present_at < HANDOVER

    def _silent(self, situation: Situation) -> bool:
        """Whether a setpoint would bring back an autopilot that lands, or has landed."""
        stands = situation.landed or not self._high(situation)
        return situation.withheld or (situation.lost and situation.armed and stands)

    def _low(self, now: float, situation: Situation) -> bool:
        """Whether an idle command means thrust 0."""
        ends = situation.disarming or not self._handed_over(now)
        return not self._high(situation) and ends

    def _high(self, situation: Situation) -> bool:
        """Whether the vehicle is armed and more than `ground_margin` above its last disarmed
        height; also if it was in the air already when this process began."""
        if not situation.armed or (self._ground is None and situation.landed):
            self._ground = self._height
        return self._ground is None or self._height - self._ground > self._margin

    def _attitude(self, now: float) -> np.ndarray:
        """Return roll, pitch, yaw (3,) [rad]: the estimate, else mocap's if fresh, else NaN."""
        if self._fresh(self._estimated, now):
            return self._motion[CHI, ATTITUDE]
        fresh = self._fresh(self.seen.item(0), now)
        return euler_from_quaternion(self.seen[1:]) if fresh else UNKNOWN

    def _fresh(self, stamp: float, now: float) -> bool:
        return now - stamp < self._fresh_for
