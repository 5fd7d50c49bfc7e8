"""Level hold: setpoints for a bounded time while the bridge has no valid command.

Then the stream of setpoints stops, and the autopilot's own failsafe (COM_OF_LOSS_T) acts.
"""

import math
from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import CHI, X, Y, Z
from uam_control.maths.compiled import borrowing, prepared
from uam_control.maths.memory import Known, Number, record
from uam_control.setpoints.targets import Desired
from uam_control.settings.parameter_set import ParameterSet, number

_LAST = 0.05  # s before the end, rates 0: the autopilot holds the last setpoint until its failsafe
UNKNOWN = np.full(3, math.nan)  # unknown attitude [rad] or velocity [m/s]
_THRUST_TIME = 0.5  # s, over which the thrust of normal flight is averaged
_FAST = 1.0  # m/s across, above which a failsafe begins with a braking
_BRAKING = 4.0  # s, its longest time: a wrong estimate must not go on for ever
# [m/s] unknown; braked by a thrust a bit below that of hover, as in the autopilot's own descent: a
# vehicle that stands already must not lift off
_CLIMBING = np.array([math.nan, math.nan, 0.3])


@dataclass(frozen=True)
class HoldParameters(ParameterSet):
    """The reaction to missing or bad commands in flight."""

    hold_time: float = number(
        2.0,
        "how long level setpoints go out in place of commands, before the stream stops",
        "s",
        0.0,
        10.0,
    )
    release_time: float = number(
        1.0,
        "the same without an estimate",
        "s",
        0.0,
        10.0,
    )
    level_time: float = number(
        0.4, "the same in the mission's failsafe: the autopilot takes over level", "s", 0.0, 10.0
    )
    hold_gain: float = number(6.0, "tilt → body rate while holding level", "1/s", 0.0, 20.0)
    hold_integral: float = number(
        6.0, "integral of the tilt → body rate, against the arm's torque", "1/s^2", 0.0, 50.0
    )
    hold_braking: float = number(
        1.0, "velocity → acceleration against it, as long as it is known", "1/s", 0.0, 5.0
    )
    hold_acceleration_limit: float = number(
        1.5, "largest acceleration against the velocity, along each axis", "m/s^2", 0.0, 5.0
    )
    hold_rate_limit: float = number(
        2.0, "largest body rate while holding level", "rad/s", 0.1, 10.0
    )
    ground_margin: float = number(
        0.3,
        "height above the start, from which an idle command means hold instead of thrust 0",
        "m",
        0.01,
        10.0,
    )


class LevelHold:
    """Makes level setpoints with the mean thrust of the flight so far; the arrays are reused.

    Under the autopilot's rate loop alone the arm's torque would tilt the vehicle: the integral acts
    against it. A swinging arm pushes the vehicle: tilt and thrust act against the velocity.
    """

    _time, _since, _slow, _thrust, _yaw = Number(), Known(), Number(), Known(), Number()

    def __init__(self, parameters: HoldParameters, gravity: float) -> None:
        """gravity [m/s^2]."""
        self.parameters = parameters
        self._gravity = gravity
        self.rates = np.zeros(3)
        self._desired = np.zeros((3, 3))  # see `Desired.attitude`
        # [s]: last tick, begin of the hold, and of its time after a braking; thrust: mean of its
        # vertical part; yaw [rad]: of the last valid command
        self.memory = record("", "time since slow thrust yaw")
        self.memory[0] = -math.inf, math.nan, math.nan, math.nan, 0.0
        self._integral = np.zeros(2)  # rad/s
        self._follow = prepared(follow_thrust, self.memory, 0.0, 0.0, 0.0, UNKNOWN, True)

    @property
    def active(self) -> bool:
        """Whether the last tick had no valid command."""
        return self._since is not None

    @property
    def mean_thrust(self) -> float:
        """The mean thrust setpoint 0..1 of the flight so far, 0 without one."""
        return self._thrust or 0.0

    def good(
        self, time: float, desired: Desired, attitude: np.ndarray, followed: bool = True
    ) -> None:
        """Store thrust and yaw of a valid command at `time` [s]; the thrust of one that is flown.

        attitude (3,): the vehicle's roll, pitch, yaw [rad]; followed: the autopilot is in OFFBOARD.
        """
        yaw = desired.attitude.item(CHI, Z)
        self._follow(self.memory, time, desired.thrust, yaw, attitude, followed)

    def reset(self) -> None:
        """Clear the mean thrust; call it while the vehicle is on the ground."""
        self._thrust = self._since = None

    def setpoint(
        self,
        time: float,
        attitude: np.ndarray,
        velocity: np.ndarray,
        longest: float | None = None,
        coasts: bool = False,
    ) -> Desired | None:
        """Return body rates, attitude and thrust at `time` [s]; None: the stream must stop.

        attitude (3,): roll, pitch, yaw [rad], FLU in ENU; an axis that is not finite gets rate 0.
        velocity (3,): [m/s], ENU; a component that is not finite is not braked. longest [s]:
        in place of `hold_time`. coasts: only a fast vehicle is braked, before `longest` begins.
        """
        if self._thrust is None:
            return None
        if self._since is None:
            self._since = self._slow = self._time = time
            self._integral[:], self._desired[CHI, Z] = 0.0, self._yaw
        if coasts and self._fast(time, velocity):
            self._slow = time
        elif coasts:
            velocity = _CLIMBING
        allowed = self.parameters.hold_time if longest is None else longest
        remaining = allowed - (time - self._slow)
        dt, self._time = max(0.0, time - self._time), time
        if remaining < 0.0:
            return None
        desired = self._desired[CHI]
        if remaining <= _LAST:
            self.rates[:] = desired[X:Z] = 0.0
            return Desired(self.rates, self._desired, self._thrust)
        forward, left, up = self._braking(velocity, attitude[Z])
        desired[X], desired[Y] = -left / self._gravity, forward / self._gravity
        self._turn(X, attitude[X] - desired[X], dt)
        self._turn(Y, attitude[Y] - desired[Y], dt)
        thrust = min(1.0, self._thrust * (1.0 + up / self._gravity))
        return Desired(self.rates, self._desired, thrust)

    def _fast(self, time: float, velocity: np.ndarray) -> bool:
        across = math.hypot(velocity[X], velocity[Y])
        return across > _FAST and time - self._since < _BRAKING

    def _turn(self, axis: int, tilt: float, dt: float) -> None:
        """Set the body rate about `axis` against the angle error `tilt` [rad]."""
        parameters = self.parameters
        limit = parameters.hold_rate_limit
        if not math.isfinite(tilt):
            tilt = 0.0
        integral = self._integral[axis] + parameters.hold_integral * tilt * dt
        self._integral[axis] = min(limit, max(-limit, integral))
        rate = -parameters.hold_gain * tilt - self._integral[axis]
        self.rates[axis] = min(limit, max(-limit, rate))

    def _braking(self, velocity: np.ndarray, yaw: float) -> tuple[float, float, float]:
        """Return accelerations forward, left and up [m/s^2] against the velocity."""
        cosine, sine = (math.cos(yaw), math.sin(yaw)) if math.isfinite(yaw) else (math.nan,) * 2
        x, y, z = velocity
        return (
            self._against(cosine * x + sine * y),
            self._against(cosine * y - sine * x),
            self._against(z),
        )

    def _against(self, speed: float) -> float:
        if not math.isfinite(speed):
            return 0.0
        limit = self.parameters.hold_acceleration_limit
        return min(limit, max(-limit, -self.parameters.hold_braking * speed))


@borrowing
def follow_thrust(
    hold: np.ndarray,
    time: float,
    thrust: float,
    yaw: float,
    attitude: np.ndarray,
    followed: bool,
) -> None:
    """Do what `LevelHold.good` does; hold (1,): its memory."""
    m = hold[0]
    m.since, m.yaw = math.nan, yaw
    if not followed:
        return
    thrust *= math.cos(attitude[X]) * math.cos(attitude[Y])
    dt = time - m.time
    m.time = time
    if math.isnan(m.thrust) or not 0.0 < dt < _THRUST_TIME:
        m.thrust = thrust
    else:
        m.thrust += dt / _THRUST_TIME * (thrust - m.thrust)
