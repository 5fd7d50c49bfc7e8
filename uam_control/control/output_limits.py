"""Limits of the three controllers, the same for every law: parameters and maths."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uam_control.control.arm_load import ArmLoadParameters
from uam_control.control.hand_steering import HandParameters
from uam_control.coordinates import CHI_DOT, X, Z
from uam_control.maths.compiled import borrowing
from uam_control.settings.parameter_set import (
    TINY,
    ParameterError,
    ParameterSet,
    choice,
    number,
    switch,
    vector,
)
from uam_control.vehicle import CURRENT_SERVO, GRAVITY, SERVO_MODES

RESERVE = 0.2  # of thrust_max, for the horizontal force if the vertical one takes all; costs 2 %


LONGEST_PREDICTION = 0.1  # [s]
WORLD, HEADING = "world", "heading"  # frames of the position's theta_hat
REFERENCE, STATE = "reference", "state"
RATE_REFERENCES = "desired", "planned", "none"


@dataclass(frozen=True)
class RateLimits(ParameterSet):
    """Limit of the bridge's setpoints."""

    rate_limit: tuple = vector(
        (6.0, 6.0, 3.0), "largest body-rate setpoint about roll, pitch, yaw", "rad/s", 0.05, 50.0, 3
    )


@dataclass(frozen=True)
class PositionLimits(ParameterSet):
    """Weight, limits of tau_p and filter of the desired attitude."""

    gravity_feedforward_mass: float = number(
        0.0, "mass whose weight is added to tau_p, 0 = the printed law", "kg", 0.0, 50.0
    )
    gravity: float = number(GRAVITY, "acceleration of gravity", "m/s^2", 0.1, 30.0)
    drag_feedforward: tuple = vector(
        (0.0, 0.0, 0.0),
        "linear drag per mass along the world axes, added for the desired velocity, 0 = none",
        "1/s",
        0.0,
        10.0,
        3,
    )
    integral_gain: tuple = vector(
        (0.0, 0.0, 0.0), "integral action on e, 0 = none, as printed", "1/s^3", 0.0, 1e3, 3
    )
    integral_limit: float = number(
        3.0, "largest acceleration of the integral action, per axis", "m/s^2", 0.0, 20.0
    )
    bias_frame: str = choice(
        WORLD,
        "where theta_hat is constant: in the world, as wind, or turning with the heading, as the "
        "force of a tilted rotor",
        (WORLD, HEADING),
    )
    thrust_min: float = number(1.0, "least upward force", "N", TINY, 1e3)
    thrust_max: float = number(36.0, "largest force", "N", TINY, 1e3)
    tilt_max: float = number(0.35, "largest angle of tau_p from the vertical", "rad", 0.01, 1.5)
    attitude_cutoff: float = number(
        5.0, "filter on the correction of the reference's attitude", "Hz", 0.1, 100.0
    )
    rotor_lag: float = number(0.05, "lag of the rotors' thrust", "s", 1e-3, 1.0)
    thrust_response: float = number(
        0.0, "lag of the thrust with a lead for that of the rotors, 0 = no lead", "s", 0.0, 1.0
    )

    def check_together(self) -> None:
        super().check_together()
        if self.thrust_min > self.thrust_max:
            raise ParameterError(
                f"thrust_min: {self.thrust_min:g} N is above thrust_max, {self.thrust_max:g} N"
            )


@dataclass(frozen=True)
class TorqueLimits(ParameterSet):
    """Largest torque per axis, of tau_q or tau_alpha."""

    torque_max: tuple = vector((), "largest torque per axis", "N m", TINY, 1e3)


@dataclass(frozen=True)
class ArmLimits(TorqueLimits, ArmLoadParameters, HandParameters):
    """Limits of tau_alpha, what is added to it, and what the servos are given."""

    integral_gain: tuple = vector(
        (0.0,), "integral action on e, 0 = none, as printed", "1/s^3", 0.0, 1e5
    )
    integral_limit: float = number(
        100.0, "largest acceleration of the integral action, per joint", "rad/s^2", 0.0, 1e4
    )

    setpoint: str = choice(
        CURRENT_SERVO,
        "what the servos are given: current = tau_alpha, position = goal positions",
        SERVO_MODES,
        fixed=True,
    )
    goal_from: str = choice(
        REFERENCE,
        "goal positions: tau_alpha goal_compliance is added to the reference, or to the state",
        (REFERENCE, STATE),
    )
    goal_compliance: float = number(
        0.0, "goal offset per torque; 0: the arm law does not act", "rad/(N m)", 0.0, 100.0
    )
    goal_rate: float = number(0.0, "rate of new goal positions, 0 = every tick", "Hz", 0.0, 1e3)


@dataclass(frozen=True)
class AttitudeLimits(TorqueLimits, ArmLoadParameters):
    """Limits of tau_q, the arm's moment, and what is left to the autopilot's rate loop."""

    prediction: float = number(
        0.0,
        "time ahead for which tau_q is computed: delay from a setpoint to its effect, 0 = none",
        "s",
        0.0,
        LONGEST_PREDICTION,
    )
    prediction_measured: bool = switch(
        False, "the measured loop delay beyond prediction_nominal is added to prediction"
    )
    prediction_nominal: float = number(
        0.007, "loop delay of a link without delay, as delay_nominal of the mission", "s", 0.0, 1.0
    )
    load_from: str = choice(
        REFERENCE,
        "the arm's moment is that of the reference, or of the measured angles, as where the arm "
        "stabilises the hand",
        (REFERENCE, STATE),
    )
    rate_reference: str = choice(
        RATE_REFERENCES[0],
        "desired body rates: of the desired attitude, those planned for the trajectory, or none",
        RATE_REFERENCES,
    )
    feedforward_washout: tuple = vector(
        (0.0, 0.0, 0.0),
        "high-pass on Omega_d_dot: I/P of the autopilot's rate loop, 0 = none",
        "1/s",
        0.0,
        100.0,
        3,
    )


class ForceCompletion(NamedTuple):
    """What `complete_and_limit` needs besides the tick's values."""

    drag: np.ndarray  # (3,) [N s/m]
    inertia: np.ndarray  # (3,) [kg]
    integral_gain: np.ndarray  # see `integrate`
    integral_limit: float  # see `integrate`
    integral_gravity: float  # [m/s^2] gravity; 0: what is carried is no weight
    weight: float  # [N]
    thrust_min: float  # [N]
    thrust_max: float  # [N]
    tilt_max: float  # [rad]


@borrowing
def limit_force(tau: np.ndarray, c: ForceCompletion, limited: np.ndarray) -> bool:
    """Write tau + weight e3 within the limits to limited (3,); return whether a limit acted.

    tau: (3,) of eq. (8a), tau_p [N, ENU].
    The vertical part has priority: the vehicle keeps its altitude, the horizontal part is reduced,
    but not below RESERVE. A vehicle too weak for its payload then sinks, and does not drift away.
    """
    largest = c.thrust_max
    upward = tau[2] + c.weight
    horizontal = math.sqrt(tau[0] * tau[0] + tau[1] * tau[1])
    kept = min(horizontal, RESERVE * largest)
    highest = math.sqrt(largest * largest - kept * kept)
    limited[2] = max(min(upward, highest), c.thrust_min)
    room = min(
        limited[2] * math.tan(c.tilt_max),
        math.sqrt(max(largest * largest - limited[2] * limited[2], 0.0)),
    )
    scale = 1.0 if horizontal <= room else room / horizontal
    limited[0] = scale * tau[0]
    limited[1] = scale * tau[1]
    return limited[2] != upward or scale != 1.0


@borrowing
def limit_torque(tau: np.ndarray, torque_max: np.ndarray, limited: np.ndarray) -> bool:
    """Write tau within ±torque_max to limited (n,); return whether a limit acted.

    tau, torque_max: (n,) [N m]; tau of eq. (18a), tau_q (FLU), or (25a), tau_alpha (per joint).
    """
    cut = False
    for i in range(len(tau)):
        limited[i] = min(max(tau[i], -torque_max[i]), torque_max[i])
        cut = cut or limited[i] != tau[i]
    return cut


@borrowing
def wash_out(feedforward: np.ndarray, corner: np.ndarray, dt: float, slow: np.ndarray) -> None:
    """Take the slow part out of feedforward (n,), in place: a first-order high-pass.

    corner (n,): [rad/s], 0 = no change; dt [s]; slow (n,): state of the filter, of the same unit;
    NaN: the present feedforward has lasted long enough, all of it is slow.
    """
    for i in range(len(feedforward)):
        if math.isnan(slow[i]):
            slow[i] = feedforward[i] if corner[i] > 0.0 else 0.0
        slow[i] += (1.0 - math.exp(-corner[i] * dt)) * (feedforward[i] - slow[i])
        feedforward[i] -= slow[i]


@borrowing
def turn_level(angle: float, bias: np.ndarray) -> None:
    """Turn bias (3,) by angle [rad] about the vertical, in place."""
    cosine, sine = math.cos(angle), math.sin(angle)
    x, y = bias[0], bias[1]
    bias[0], bias[1] = cosine * x - sine * y, sine * x + cosine * y


@borrowing
def integrate(
    e: np.ndarray, gain: np.ndarray, limit: float, saturated: bool, dt: float, integral: np.ndarray
) -> None:
    """Advance integral (n,) of gain e by dt [s], in place, within ±limit.

    e (n,): tracking error [m or rad]; gain (n,) [1/s^3]; integral and limit [m/s^2 or rad/s^2].
    While saturated it does not grow.
    """
    for i in range(len(e)):
        following = integral[i] + gain[i] * e[i] * dt
        if not (saturated and abs(following) > abs(integral[i])):
            integral[i] = min(limit, max(-limit, following))


@borrowing
def complete_and_limit(
    reference: np.ndarray,
    e: np.ndarray,
    c: ForceCompletion,
    saturated: bool,
    dt: float,
    carried: tuple[np.ndarray, np.ndarray],
    tau: np.ndarray,
    limited: np.ndarray,
) -> bool:
    """Add drag and integral action to the law's force tau (3,), write it within its limits to
    limited (3,), both [N, ENU]; return whether a limit acted.

    reference (3, 6 + n): see `coordinates`; carried: bias (3,) [m/s^2] of the law, part of tau, and
    integral; e, saturated, dt: see `integrate`. What bias and integral hold up is weight, so the
    rest of the force is for that mass, too.
    """
    bias, integral = carried
    integrate(e, c.integral_gain, c.integral_limit, saturated, dt, integral)
    held = integral[Z] + bias[Z]
    heavier = 1.0 - held / c.integral_gravity if c.integral_gravity > 0.0 else 1.0
    for i in range(len(tau)):
        own = tau[i] + c.inertia[i] * bias[i] + c.drag[i] * reference[CHI_DOT, X + i]
        tau[i] = own * heavier - c.inertia[i] * (integral[i] + bias[i])
    return limit_force(tau, c, limited)
