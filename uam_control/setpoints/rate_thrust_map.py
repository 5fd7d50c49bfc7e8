"""tau_p [N] and tau_q [N m] → body-rate setpoint [rad/s] and normalised thrust.

Thrust. The collective is the part of tau_p along the body's thrust axis, u1 = tau_p · (R e3). It is
clamped to [thrust_min, thrust_max] and mapped to 0..1 by the inverse of the thrust curve.

With `throttle_per_newton` c the motor command is c ||tau_p|| instead, without a thrust curve: the
convention of many laboratories, in which tau_p is an acceleration of a unit mass (docs/law.md).
The bridge inverts only the autopilot's curve, as if THR_MDL_FAC were 0.

Rates. PX4's rate loop makes the torque

    tau = S ( K P (omega_sp - omega) + integral - K D omega_dot )

with S the torque [N m] of a normalised torque of 1 (torque_scale). Sending

    omega_sp = omega + tau_q / (S K P)

makes the proportional path equal to tau_q. The other paths help: the integral acts as integral
action on tau_q (K I / (K P) of it per second) and compensates constant torques such as the arm's
weight; D acts as rate damping.

Both use the thrust of the motors: full thrust × battery × `thrust_factor`, which is identified in
flight (thrust_identification.py). An error of this product scales u1 and tau_q by the same factor.

Assumptions: omega is the rate that the loop uses (its gyro filter is ignored); K P, the thrust
curve and the rotor geometry here are those of the autopilot (the bridge reads and compares them);
the motors do not saturate. If the autopilot's thrust model differs from the motors' curve, S is
scaled by the local slope of the composed curve.

Body vectors are FLU. The map is the same in FRD: the signs cancel.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from uam_control.control.output_limits import RateLimits
from uam_control.coordinates import ALPHA, CHI, CHI_DOT, ROLL
from uam_control.maths.compiled import borrowing, prepared
from uam_control.maths.memory import Number, record
from uam_control.setpoints.thrust_curve import (
    command_of_thrust,
    curve,
    thrust_of_command,
    thrust_slope,
)
from uam_control.settings.parameter_set import number, vector
from uam_control.vehicle import VehicleDescription, derived_parameters, load_description
from uam_control.vehicle.rotor_geometry import torque_scale

# entries of the flat parameter array of the compiled map
(_FULL, _BATTERY, _MOTOR, _MODEL, _MIN, _MAX, _COMMAND_MAX, _GAIN, _LIMIT) = (
    0, 1, 2, 3, 4, 5, 6, 7, 10,
)  # fmt: skip
_THROTTLE = 13
_LENGTH = 14

INPUTS = (
    *(f"tau_p.{axis}" for axis in "xyz"),
    *(f"tau_q.{axis}" for axis in ("roll", "pitch", "yaw")),
    *(f"attitude.{axis}" for axis in ("roll", "pitch", "yaw")),
    *(f"body rate {axis}" for axis in "xyz"),
)


class SetpointRefused(ValueError):
    """The input of the map is not finite; the text names the first such value."""


@dataclass(frozen=True)
class RateThrustParameters(RateLimits):
    """Numbers of vehicle and autopilot that the map uses.

    Values that are NaN or empty by default come from the vehicle's description: `of`.
    """

    rotor_thrust_max: float = number(
        math.nan, "thrust of one rotor at full command and full battery", "N", 0.1, 1000.0
    )
    motor_curve_factor: float = number(
        math.nan, "f in thrust/full thrust = f u^2 + (1 - f) u of motor command u", "1", 0.0, 1.0
    )
    battery_factor: float = number(
        1.0, "full thrust now / full thrust with a full battery", "1", 0.2, 1.5
    )
    thr_mdl_fac: float = number(math.nan, "THR_MDL_FAC of the autopilot", "1", 0.0, 1.0)
    rate_p: tuple = vector(
        (),
        "MC_ROLLRATE_P, MC_PITCHRATE_P, MC_YAWRATE_P of the autopilot",
        "1/(rad/s)",
        0.001,
        10.0,
        3,
    )
    rate_k: tuple = vector(
        (),
        "MC_ROLLRATE_K, MC_PITCHRATE_K, MC_YAWRATE_K of the autopilot",
        "1",
        0.01,
        10.0,
        3,
    )
    thrust_min: float = number(1.0, "smallest collective sent in flight", "N", 0.0, 1000.0)
    thrust_max: float = number(40.0, "largest collective sent", "N", 0.1, 4000.0)
    command_max: float = number(
        1.0, "largest normalised thrust sent; below 1 leaves room for torques", "1", 0.1, 1.0
    )
    throttle_per_newton: float = number(
        0.0, "motor command per newton of ||tau_p||, without thrust curve; 0 = off", "1/N", 0.0, 1.0
    )

    @classmethod
    def of(cls, vehicle: VehicleDescription, values: Mapping[str, Any] | None = None) -> Self:
        """Return the validated set of a vehicle, with those of `values` that belong to the set."""
        return cls.among(derived_parameters(vehicle)["mavlink_bridge"] | dict(values or {}))

    def torque_scale(self, vehicle: VehicleDescription) -> np.ndarray:
        """Return the torque (3,) [N m, FLU] of a normalised torque of 1 about roll, pitch, yaw."""
        return torque_scale(*vehicle.geometry(), self.rotor_thrust_max)

    def flat(self, vehicle: VehicleDescription) -> np.ndarray:
        """Return the parameters (14,) of `rate_thrust_map`, SI units."""
        p = np.empty(_LENGTH)
        p[_FULL] = len(vehicle.rotors) * self.rotor_thrust_max
        p[_BATTERY] = self.battery_factor
        p[_MOTOR] = self.motor_curve_factor
        p[_MODEL] = self.thr_mdl_fac
        p[_MIN] = self.thrust_min
        p[_MAX] = self.thrust_max
        p[_COMMAND_MAX] = self.command_max
        p[_THROTTLE] = self.throttle_per_newton
        scale = self.torque_scale(vehicle)
        p[_GAIN : _GAIN + 3] = scale * np.array(self.rate_p) * np.array(self.rate_k)
        p[_LIMIT : _LIMIT + 3] = self.rate_limit
        return p


@borrowing
def rate_thrust_map(
    tau_p: np.ndarray,
    tau_q: np.ndarray,
    attitude: np.ndarray,
    body_rates: np.ndarray,
    p: np.ndarray,
    rates: np.ndarray,
) -> float:
    """Write the body-rate setpoint [rad/s, FLU] into rates (3,); return the normalised thrust.

    tau_p (3,) [N, ENU], tau_q (3,) [N m, FLU], attitude (3,) roll, pitch, yaw [rad, FLU in ENU],
    body_rates (3,) [rad/s, FLU], p (14,): `RateThrustParameters.flat`. Returns -1 - i and leaves
    `rates` unchanged if INPUTS[i] is not finite.
    """
    for i in range(3):
        if not math.isfinite(tau_p[i]):
            return -1.0 - i
        if not math.isfinite(tau_q[i]):
            return -4.0 - i
        if not math.isfinite(attitude[i]):
            return -7.0 - i
        if not math.isfinite(body_rates[i]):
            return -10.0 - i
    # third column of R_B^W: the thrust axis in the world frame
    cr, sr = math.cos(attitude[0]), math.sin(attitude[0])
    cp, sp = math.cos(attitude[1]), math.sin(attitude[1])
    cy, sy = math.cos(attitude[2]), math.sin(attitude[2])
    newtons = (
        tau_p[0] * (cy * sp * cr + sy * sr)
        + tau_p[1] * (sy * sp * cr - cy * sr)
        + tau_p[2] * cp * cr
    )
    if p[_THROTTLE] > 0.0:
        newtons = math.sqrt(tau_p[0] ** 2 + tau_p[1] ** 2 + tau_p[2] ** 2)
        newtons = min(p[_MAX], max(p[_MIN], newtons))
        thrust = curve(p[_MODEL], p[_THROTTLE] * newtons)
    else:
        newtons = min(p[_MAX], max(p[_MIN], newtons))
        thrust = command_of_thrust(newtons, p[_FULL], p[_BATTERY], p[_MOTOR], p[_MODEL])
    thrust = min(p[_COMMAND_MAX], thrust)
    slope = thrust_slope(thrust, p[_FULL], p[_BATTERY], p[_MOTOR], p[_MODEL]) / p[_FULL]
    for i in range(3):
        desired = body_rates[i] + tau_q[i] / (p[_GAIN + i] * slope)
        limit = p[_LIMIT + i]
        rates[i] = min(limit, max(-limit, desired))
    return thrust


@borrowing
def rate_thrust_of_state(
    tau_p: np.ndarray, tau_q: np.ndarray, state: np.ndarray, p: np.ndarray, rates: np.ndarray
) -> float:
    """Return `rate_thrust_map` of the attitude and body rates in state (3, 6 + n)."""
    attitude, body_rates = state[CHI, ROLL:ALPHA], state[CHI_DOT, ROLL:ALPHA]
    return rate_thrust_map(tau_p, tau_q, attitude, body_rates, p, rates)


@borrowing
def use_factor(memory: np.ndarray, flat: np.ndarray, factor: float) -> None:
    """Use a thrust factor; memory (1,), flat (14,): of the `RateThrustMap`."""
    m = memory[0]
    m.factor = factor
    flat[_BATTERY] = m.battery * factor


class RateThrustMap:
    """`rate_thrust_map` with its parameters; one instance per flight.

    `rates` (3,) [rad/s, FLU] is reused by every call: copy it to keep it. `thrust_factor`: true
    thrust / thrust of the parameters' curve, 1 at first.
    """

    _factor = Number()

    def __init__(
        self,
        parameters: RateThrustParameters | None = None,
        vehicle: VehicleDescription | None = None,
    ) -> None:
        """parameters: None for those of the vehicle; vehicle: None for the default one."""
        self.rates = np.zeros(3)
        self.flat = np.zeros(_LENGTH)  # see `RateThrustParameters.flat`; never replaced
        # battery: full thrust now / full thrust with a full battery, by the parameters
        self.memory = record("", "factor battery")
        self._factor = 1.0
        self._vehicle = vehicle or load_description()
        self.gravity = self._vehicle.gravity  # [m/s^2]
        self.configure(parameters or RateThrustParameters.of(self._vehicle))
        three = self.rates
        self._map = prepared(rate_thrust_map, three, three, three, three, self.flat, three)

    def configure(self, parameters: RateThrustParameters) -> None:
        """Apply new parameters; a ParameterError names the bad one and changes nothing."""
        checked = parameters.validated()
        self.flat[:] = p = checked.flat(self._vehicle)
        self.curve = tuple(p[[_FULL, _BATTERY, _MOTOR, _MODEL]].tolist())  # for `thrust_of_command`
        self.parameters = checked
        self._torque_scale = checked.torque_scale(self._vehicle)
        self.memory["battery"] = checked.battery_factor
        self.thrust_factor = self._factor

    @property
    def thrust_factor(self) -> float:
        """True thrust / thrust of the parameters' curve."""
        return self._factor

    @thrust_factor.setter
    def thrust_factor(self, factor: float) -> None:
        """Set the factor; raises ValueError, without a change, if it is not a positive number."""
        if not (math.isfinite(factor) and factor > 0.0):
            raise ValueError(f"thrust factor {factor} is not a positive number")
        use_factor(self.memory, self.flat, factor)

    def map(
        self, tau_p: np.ndarray, tau_q: np.ndarray, attitude: np.ndarray, body_rates: np.ndarray
    ) -> tuple[np.ndarray, float]:
        """Return the body-rate setpoint (3,) [rad/s, FLU] and the normalised thrust 0..1.

        float64 arrays as in `rate_thrust_map`. Raises SetpointRefused if one is not finite.
        """
        thrust = self._map(tau_p, tau_q, attitude, body_rates, self.flat, self.rates)
        if thrust < 0.0:
            raise SetpointRefused(f"{INPUTS[int(-thrust) - 1]} is not finite")
        return self.rates, thrust

    def normalised(self, tau_q: np.ndarray, thrust: float) -> np.ndarray:
        """Return tau_q (3,) [N m, FLU] in parts of the largest torque, at the normalised thrust."""
        p = self.flat
        slope = thrust_slope(thrust, *self.curve) / p[_FULL]
        return tau_q / (self._torque_scale * slope)

    def scaled(self, command: float, factor: float) -> float:
        """Return the normalised thrust that makes `factor` times the thrust of `command`."""
        p = self.flat
        curves = p[_FULL], p[_BATTERY], p[_MOTOR], p[_MODEL]
        return command_of_thrust(factor * thrust_of_command(command, *curves), *curves)
