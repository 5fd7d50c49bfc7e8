"""PX4's position cascade (v1.16): in OFFBOARD, and in HOLD, POSITION (sticks) and RETURN.

    v_sp = v_ff + P_p (p_sp - p), limited;   a_sp = a_ff + P_v (v_sp - v) + integral - D_v dv/dt
    thrust direction from the horizontal acceleration and gravity, limited tilt
    collective = (hover thrust (1 - a_sp,z / g)) / cos(tilt)

With MPC_ACC_DECOUPLE 1, the default, the vertical acceleration does not change the tilt. The
integral stops vertically while the thrust saturates, and horizontally by tracking (arw_gain). PX4
runs this loop at the rate of its estimate, some 100 Hz, and estimates the hover thrust for it
(MPC_USE_HTE), here for the other modes only; it runs at each sample, in OFFBOARD with
MPC_THR_HOVER. The other modes are those of a pilot or of a failsafe, and slow. All vectors are NED.

The descent of a failsafe (PX4's mode Descend) is level, with a constant sink speed. Without a valid
vertical velocity the thrust is a bit below that of hover, as in PX4. PX4 keeps that thrust on the
ground, too, and its land detector then needs the velocity that is missing. Here the thrust falls
when every vehicle of a laboratory has come down, so that the landing is detected.
"""

import math

import numpy as np

from uam_control.maths.rotations import euler_from_quaternion, quaternion_from_euler
from uam_control.offboard.modes import Mode
from uam_control.setpoints.targets import PositionTarget
from uam_sim_bridge.autopilot.autopilot_estimator import ATTITUDE, DOWN, GRAVITY, POSITION, VELOCITY
from uam_sim_bridge.autopilot.loops.attitude_control import attitude_gains, attitude_rates
from uam_sim_bridge.autopilot.params import Parameters

MODES = (Mode.HOLD, Mode.POSITION, Mode.RETURN)
_STICK_ZERO = 0.1  # stick deflection that counts as none (PX4: MPC_HOLD_DZ)
_AT_HOME = 0.3  # m, horizontal distance from which RETURN descends
_FAST = 1.0  # m/s across, faster than which a descent brakes
_BRAKING = 0.5  # s, the held position lies this far ahead of a moving vehicle
_BELOW_HOVER = 0.3  # m/s^2 down, without a valid vertical velocity (PX4)
_DOWN_BY_NOW = 5.0  # s of such a descent, after which the thrust falls
_FALLING = 1.0  # m/s^3, the fall of the thrust


class PositionControl:
    """The cascade of OFFBOARD; call `reset` while another mode flies."""

    SPEEDS = ("MPC_XY_VEL_MAX", "MPC_Z_VEL_MAX_UP", "MPC_Z_VEL_MAX_DN")  # across, up, down

    def __init__(self, parameters: Parameters) -> None:
        self.setpoint = np.zeros(4)  # body rates [rad/s, FRD], thrust
        self._integral = np.zeros(3)  # [m/s^2]
        self._velocity: np.ndarray | None = None  # of the last cycle
        self._slope = np.zeros(3)  # [m/s^2] low-pass filtered derivative of the velocity
        self.configure(parameters)

    def configure(self, parameters: Parameters) -> None:
        p = self._parameters = parameters
        self._position_gain = _gains(p, "P")
        self._p, self._i, self._d = (_gains(p, f"VEL_{kind}_ACC") for kind in "PID")
        self._attitude_gains = attitude_gains(p)
        self._across, self._up, self._down = p.vector(*self.SPEEDS)
        self._hover = p["MPC_THR_HOVER"]

    def reset(self) -> None:
        if self._velocity is not None:
            self._integral[:], self._slope[:], self._velocity = 0.0, 0.0, None

    def update(self, target: PositionTarget, estimate: np.ndarray, dt: float) -> np.ndarray:
        """Return body rates [rad/s, FRD], thrust (4,); estimate (10,): of `Estimator`; dt [s]."""
        p = self._parameters
        position, velocity = estimate[POSITION], estimate[VELOCITY]
        self._differentiate(velocity, dt)
        back = self._position_gain * (target.position - position)
        desired = back + target.velocity
        limit_across(back, target.velocity, self._across, desired)
        desired[2] = min(self._down, max(-self._up, desired[2]))
        error = desired - velocity
        self._integral[2] = min(GRAVITY, max(-GRAVITY, self._integral[2]))
        acceleration = (
            target.acceleration + self._p * error + self._integral - self._d * self._slope
        )
        axis, thrust = self._thrust(acceleration)
        least, most = p["MPC_THR_MIN"], p["MPC_THR_MAX"]
        if (thrust[2] >= -least and error[2] >= 0.0) or (thrust[2] <= -most and error[2] <= 0.0):
            error[2] = 0.0
        # vertical thrust comes first, but leaves a margin for the horizontal one
        across = math.hypot(thrust[0], thrust[1])
        kept = min(across, p["MPC_THR_XY_MARG"])
        thrust[2] = max(thrust[2], -math.sqrt(most * most - kept * kept))
        allowed = math.sqrt(max(0.0, most * most - thrust[2] * thrust[2]))
        if across > allowed:
            thrust[:2] *= allowed / across
        produced = thrust[:2] * GRAVITY / self._hover
        if acceleration[0] ** 2 + acceleration[1] ** 2 > produced[0] ** 2 + produced[1] ** 2:
            error[:2] -= 2.0 / self._p[0] * (acceleration[:2] - produced)
        self._integral += self._i * error * dt
        size = math.sqrt(float(thrust @ thrust))
        if size > 1e-6:
            axis = -thrust / size
        attitude_rates(
            estimate[ATTITUDE],
            attitude_of(axis, target.yaw),
            target.yaw_rate,
            self._attitude_gains,
            self.setpoint,
        )
        self.setpoint[3] = min(most, size)
        return self.setpoint

    def _differentiate(self, velocity: np.ndarray, dt: float) -> None:
        if self._velocity is not None:
            share = dt / (dt + 1.0 / (2.0 * math.pi * self._parameters["MPC_VELD_LP"]))
            self._slope += share * ((velocity - self._velocity) / dt - self._slope)
        self._velocity = velocity.copy()

    def _thrust(self, acceleration: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the body's z axis (3,) and the thrust (3,), normalised, of acceleration (3,)."""
        p = self._parameters
        down = GRAVITY if p["MPC_ACC_DECOUPLE"] else GRAVITY - acceleration[2]
        axis = np.array([-acceleration[0], -acceleration[1], down])
        axis /= math.sqrt(float(axis @ axis))
        tilt = math.radians(p["MPC_TILTMAX_AIR"])
        across = math.hypot(axis[0], axis[1])
        if math.atan2(across, axis[2]) > tilt:
            axis[:2] *= math.sin(tilt) / across
            axis[2] = math.cos(tilt)
        vertical = acceleration[2] * self._hover / GRAVITY - self._hover
        return axis, axis * min(vertical / axis[2], -p["MPC_THR_MIN"])


def _gains(p: Parameters, name: str) -> np.ndarray:
    """Return a gain (3,) that is the same for both horizontal axes."""
    return np.array(p.vector(f"MPC_XY_{name}", f"MPC_XY_{name}", f"MPC_Z_{name}"))


def limit_across(first: np.ndarray, second: np.ndarray, most: float, total: np.ndarray) -> None:
    """Write first + second, horizontally at most `most` [m/s], to total (3,); first has priority.

    Source: PX4, ControlMath::constrainXY.
    """
    a, b = first[:2], second[:2]
    if math.hypot(*(a + b)) <= most:
        return
    size = math.hypot(*a)
    if size >= most:
        total[:2] = a / size * most
        return
    other = math.hypot(*b)
    along = float(a @ b) / other
    scale = -along + math.sqrt(along * along - (size * size - most * most))
    total[:2] = a + b / other * scale


def attitude_of(axis: np.ndarray, yaw: float) -> np.ndarray:
    """Return the attitude (4,) FRD → NED with the body's z axis `axis` (3,), z > 0, and yaw [rad].

    As PX4's ControlMath::bodyzToAttitude: the body's x axis has no part across the yaw.
    """
    forward = math.cos(yaw) * axis[0] + math.sin(yaw) * axis[1]
    right = math.cos(yaw) * axis[1] - math.sin(yaw) * axis[0]
    roll = -math.asin(min(1.0, max(-1.0, right)))
    return quaternion_from_euler(np.array([roll, math.atan2(forward, axis[2]), yaw]))


class PositionModes(PositionControl):
    """The cascade of the modes without a companion, with lower speeds; of a failsafe's descent.

    `sinking`, `climbing`: whether the last setpoint descends to the ground, or climbs by the stick.
    """

    SPEEDS = ("MPC_VEL_MANUAL", "MPC_LAND_SPEED", "MPC_LAND_SPEED")

    def __init__(self, parameters: Parameters) -> None:
        super().__init__(parameters)
        self.home = np.zeros(3)  # position of arming [m, NED]
        self.sticks = np.zeros(4)  # forward, right, up, yaw clockwise, -1..1
        self.sinking = self.climbing = False
        self._held: np.ndarray | None = None  # position [m, NED]
        self._mode: Mode | None = None
        self._yaw = 0.0
        self._blind = 0.0  # s of a descent without a valid vertical velocity

    def reset(self) -> None:
        super().reset()
        self._mode, self.sinking, self._blind = None, False, 0.0

    def fly(self, mode: Mode, estimate: np.ndarray, dt: float, hover: float) -> np.ndarray:
        """Return as `update`; hover: thrust of hover, as estimated."""
        position = estimate[POSITION]
        if mode is not self._mode:
            self.reset()
            self._mode, self._held = mode, position + _BRAKING * estimate[VELOCITY]
            self._yaw = float(euler_from_quaternion(estimate[ATTITUDE])[2])
        self._hover = hover
        velocity = self._desired_velocity(mode, position, dt)
        self._held = np.where(velocity == 0.0, self._held, position)
        target = PositionTarget(0, self._held, velocity, np.zeros(3), self._yaw, 0.0)
        return self.update(target, estimate, dt)

    def _desired_velocity(self, mode: Mode, position: np.ndarray, dt: float) -> np.ndarray:
        """Return the desired velocity (3,) [m/s, NED], 0 along an axis whose position is held."""
        lands, self.sinking, self.climbing = self.sinking, False, False
        velocity = np.zeros(3)
        if mode is Mode.RETURN:
            self._held[:2] = self.home[:2]
            away = math.hypot(*(self.home[:2] - position[:2]))
            self.sinking = lands or away < _AT_HOME  # the ground may push it off
            velocity[2] = self._down if self.sinking else 0.0
        if mode is Mode.POSITION:
            sticks = np.where(np.abs(self.sticks) > _STICK_ZERO, self.sticks, 0.0)
            cosine, sine = math.cos(self._yaw), math.sin(self._yaw)
            forward, right = self._across * sticks[:2]
            velocity[:2] = cosine * forward - sine * right, sine * forward + cosine * right
            velocity[2] = -self._up * sticks[2]
            self.sinking, self.climbing = bool(sticks[2] < 0.0), bool(sticks[2] > 0.0)
            self._yaw += math.radians(self._parameters["MPC_MAN_Y_MAX"]) * sticks[3] * dt
        return velocity

    def descend(
        self, estimate: np.ndarray, dt: float, sink_known: bool, contact: bool, hover: float
    ) -> np.ndarray:
        """Return as `fly`. Across only what is faster than _FAST is seen, and braked; else it stays
        level. PX4 stops across where it knows its velocity (mode Land).

        sink_known: the vertical velocity is valid; contact: the ground is touched, and the vehicle
        only waits for the end of the flight, as in PX4.
        """
        if contact or self._mode is not Mode.LAND:
            self.reset()
            self._mode = Mode.LAND
        self._hover = hover
        velocity, acceleration, seen = np.zeros(3), np.zeros(3), estimate.copy()
        seen[VELOCITY] = 0.0
        if contact:
            acceleration[2] = GRAVITY
        elif sink_known:
            velocity[2], seen[DOWN] = self._down, estimate[DOWN]
            across = estimate[VELOCITY][:2]
            seen[VELOCITY][:2] = across * (1.0 - _FAST / max(_FAST, math.hypot(*across)))
        else:
            self._blind += dt
            acceleration[2] = _BELOW_HOVER + _FALLING * max(0.0, self._blind - _DOWN_BY_NOW)
        self._integral[:2] = 0.0
        yaw = float(euler_from_quaternion(estimate[ATTITUDE])[2])
        target = PositionTarget(0, estimate[POSITION], velocity, acceleration, yaw, 0.0)
        return self.update(target, seen, dt)
