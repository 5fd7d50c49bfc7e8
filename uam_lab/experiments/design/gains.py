"""Bandwidths of the loops → parameters of the autopilot and sections of a profile.

The rate loop comes first. With the inertia J, the torque S of a normalised torque of 1,
d = S K D / J, and a lag T of rotor and dead time, the loop J T s^2 + J (1 + d) s + S K P = 0 has
the damping `rate.damping` for

    lambda_2 = S K P / (J (1 + d)) = (1 + d) / (4 damping^2 T)

J (1 + d) = Mbar and lambda_2 are those of the attitude law: Mbar lambda_2 = S K P, so that the
measured body rates cancel in the setpoint (docs/tuning.md). 1 + d is bisected: as large as dead
time, noise and torque allow. Where less than 1 is allowed, d = 0 and the loop is slower.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from uam_control.control.output_limits import RateLimits
from uam_control.coordinates import ROLL, YAW
from uam_control.laws.modular import lyapunov_solution
from uam_control.settings import configuration
from uam_control.settings.parameter_file import read_sections
from uam_control.settings.section import read_section
from uam_control.vehicle import AXES, VehicleDescription
from uam_lab.experiments.design.criteria import DesignError
from uam_lab.experiments.design.facts import Facts
from uam_sim_bridge.autopilot.params import DEFINITIONS

DIGITS = 4
# MC_*RATE_K scales the gains of an axis to at most these: PX4's ranges of roll
MOST_P, MOST_D = 0.5, 0.01
TIPPED = 0.2, 0.4  # [rad] beyond tilt_max at which the supervisor holds, and gives up
MISSED = 0.5, 1.0  # [s] of missed ticks at which it does
LEAST_THRUST = 0.05  # share of the weight
LEAST_TILT = 0.1  # [rad] of tilt_max, for rotors that can hardly lift
LEAST, STEPS = 1e-3, 40  # of 1 + d, and of its bisection


class RateLoop(NamedTuple):
    """P, I, D of one axis with K = 1."""

    p: float
    i: float
    d: float
    stiffness: float  # S K P [N m s/rad]
    inertia: float  # Mbar [kg m^2]
    bandwidth: float  # lambda_2 [rad/s]
    limit: str  # what keeps it from being faster


def rate_loop(facts: Facts, axis: int, criteria: SimpleNamespace, share: float) -> RateLoop:
    """Return the loop of an axis; share: of 1 + d that is used."""
    lag, late = facts.lag[axis], facts.dead + facts.slope
    # crossover of the path of D, d / (lag s + 1), where the dead time takes dead_phase
    high = math.sqrt(1.0 + (criteria.rate.dead_phase / late * lag) ** 2) + 1.0
    if reason := _exceeded(facts, axis, criteria, high):
        low, limit = LEAST, reason
        for _ in range(STEPS):
            middle = 0.5 * (low + high)
            if reason := _exceeded(facts, axis, criteria, middle):
                high, limit = middle, reason
            else:
                low = middle
        return _loop(facts, axis, criteria, share * low, limit)
    limit = f"rotor lag {1e3 * facts.lag[axis]:.0f} ms, dead time {1e3 * late:.0f} ms"
    return _loop(facts, axis, criteria, share * high, limit)


def _loop(facts: Facts, axis: int, criteria: SimpleNamespace, sum_: float, limit: str) -> RateLoop:
    """Return the loop with 1 + d = sum_."""
    d = max(sum_ - 1.0, 0.0)
    bandwidth = sum_ / (4.0 * criteria.rate.damping**2 * (facts.lag[axis] + facts.dead))
    inertia = facts.inertia[axis] * (1.0 + d)
    p = inertia * bandwidth / facts.scale[axis]
    return RateLoop(
        *(p, criteria.rate.integral * bandwidth * p, d * facts.inertia[axis] / facts.scale[axis]),
        *(inertia * bandwidth, inertia, bandwidth, limit),
    )


def _exceeded(facts: Facts, axis: int, criteria: SimpleNamespace, sum_: float) -> str:
    """Return the criterion that 1 + d = sum_ does not meet, "" if it meets all."""
    loop = _loop(facts, axis, criteria, sum_, "")
    torque = criteria.authority.torque[axis] * facts.torque[axis]
    error = criteria.saturation.attitude
    if loop.stiffness * criteria.attitude * loop.bandwidth * error > torque:
        return f"torque {torque:.2g} N m"
    gains = np.array([loop.p, loop.d])
    if math.sqrt(gains @ facts.noise[axis] @ gains) > criteria.noise:
        return f"gyroscope noise, {100 * criteria.noise:g} % of the command"
    return ""


@dataclass(frozen=True)
class Bandwidths:
    """Bandwidths of the loops, all in [rad/s]."""

    rates: tuple[RateLoop, ...]  # of the autopilot, about roll, pitch, yaw
    attitude: np.ndarray  # (3,) lambda_1 / lambda_2
    position: np.ndarray  # (3,) lambda_2
    arm: np.ndarray  # (n,) lambda_2


def autopilot_gains(found: Bandwidths) -> dict[str, float]:
    """Return the autopilot's parameters, by PX4's names."""
    values: dict[str, float] = {}
    for name, loop, attitude in zip(AXES, found.rates, found.attitude, strict=True):
        scale = max(1.0, loop.p / MOST_P, loop.d / MOST_D if name != AXES[-1] else 0.0)
        scale = min(scale, DEFINITIONS[f"MC_{name}RATE_K"].high)
        for letter, gain in zip("PID", (loop.p, loop.i, loop.d), strict=True):
            values[f"MC_{name}RATE_{letter}"] = rounded(gain / scale)
        values[f"MC_{name}RATE_K"] = rounded(scale)
        usual = DEFINITIONS[f"MC_{name}_P"].default
        values[f"MC_{name}_P"] = rounded(min(usual, attitude))
    fixed = read_section(configuration.path("design/autopilot.yaml"), DesignError)
    return values | fixed.values


def sections(
    described: VehicleDescription, facts: Facts, found: Bandwidths, criteria: SimpleNamespace
) -> dict[str, dict[str, Any]]:
    """Return the sections of the profile by node, without `delay_margin`."""
    fixed = read_sections(configuration.path("design/profile.yaml"))
    position = _position(described, facts, found, criteria, fixed["position_controller"])
    own = {
        "position_controller": position,
        "attitude_controller": _attitude(facts, found, criteria, fixed["attitude_controller"]),
        "arm_controller": _arm(facts, found, criteria, fixed["arm_controller"]),
        "state_estimator": estimator(described, criteria),
        "mission": _mission(described, found, position["tilt_max"]),
        "mavlink_bridge": _bridge(described, facts, criteria),
    }
    return {node: fixed.get(node, {}) | values for node, values in own.items()}


def thrust_response(
    described: VehicleDescription, facts: Facts, criteria: SimpleNamespace
) -> float:
    """Return the lag [s] that the thrust has with a lead, 0 without one: that with which rotors
    limit z no more than the estimator does, but no more lead than `criteria.lead`."""
    own = float(described.rotor.lag)
    seen = criteria.estimate * estimator(described, criteria)["position_bandwidth"]
    wanted = max(criteria.vertical / seen - facts.seen, own / criteria.lead)
    return rounded(wanted) if wanted < own else 0.0


def _position(
    described: VehicleDescription,
    facts: Facts,
    found: Bandwidths,
    criteria: SimpleNamespace,
    fixed: dict,
) -> dict[str, Any]:
    thrust = criteria.authority.thrust * described.full_thrust
    weight = described.mass * described.gravity
    tilt = math.acos(min(1.0, criteria.authority.weight * weight / thrust))
    tilt = min(criteria.authority.tilt, max(tilt, LEAST_TILT))
    corner = criteria.attitude_filter * float(np.mean(found.attitude[: YAW - ROLL]))
    values = _feedback(found.position, criteria, criteria.adaptation.position, fixed)
    return values | {
        "inertia": [described.mass] * len(found.position),
        "thrust_min": rounded(LEAST_THRUST * weight),
        "thrust_max": rounded(thrust),
        "tilt_max": rounded(tilt),
        "attitude_cutoff": rounded(corner / (2.0 * math.pi)),
        "rotor_lag": described.rotor.lag,
        "thrust_response": thrust_response(described, facts, criteria),
    }


def _attitude(
    facts: Facts, found: Bandwidths, criteria: SimpleNamespace, fixed: dict
) -> dict[str, Any]:
    second = np.array([loop.bandwidth for loop in found.rates])
    share = criteria.adaptation.attitude
    return _law(second * found.attitude, second, criteria, share, fixed) | {
        "inertia": listed(np.array([loop.inertia for loop in found.rates])),
        "torque_max": listed(np.array(criteria.authority.torque) * facts.torque),
        "arm_feedforward": True,
    }


def _arm(facts: Facts, found: Bandwidths, criteria: SimpleNamespace, fixed: dict) -> dict[str, Any]:
    torque = criteria.authority.servo * facts.servo
    # the limit of theta_hat is one number for all joints: what none of them exceeds
    most = 0.5 * float(np.min(torque / facts.joints))
    return _feedback(found.arm, criteria, criteria.adaptation.arm, fixed) | {
        "inertia": listed(facts.joints),
        "lambda_table": [1.0] * len(found.arm),
        "bias_limit": rounded(most),
        "torque_max": listed(torque),
        "arm_feedforward": True,
    }


def estimator(described: VehicleDescription, criteria: SimpleNamespace) -> dict[str, float]:
    """Return the estimator's bandwidths for the rate and the age of the vehicle's poses."""
    mocap, c = described.numbers["sensors"]["mocap"], criteria.estimator
    age = mocap["latency_ticks"] * described.control_period + 1e-9
    most = min(c.interval * mocap["rate"], c.age / age)
    return {
        "position_bandwidth": rounded(min(c.position, most)),
        "attitude_bandwidth": rounded(min(c.attitude, most)),
    }


def _mission(described: VehicleDescription, found: Bandwidths, tilt: float) -> dict[str, Any]:
    (hold, failsafe), period = TIPPED, described.control_period
    slowest = min(loop.bandwidth for loop in found.rates[: YAW - ROLL])
    return {
        "tilt_hold": rounded(tilt + hold),
        "tilt_failsafe": rounded(tilt + failsafe),
        "rate_lag": rounded(1.0 / slowest),
        "missed_ticks_hold": float(round(MISSED[0] / period)),
        "missed_ticks_failsafe": float(round(MISSED[1] / period)),
    }


def _bridge(
    described: VehicleDescription, facts: Facts, criteria: SimpleNamespace
) -> dict[str, Any]:
    torque = np.array(criteria.authority.torque) * facts.torque
    reached = criteria.authority.spin_up * torque / facts.inertia
    most = 0.5 * (criteria.authority.thrust + 1.0) * described.full_thrust
    return {
        "thrust_min": rounded(LEAST_THRUST * described.mass * described.gravity),
        "thrust_max": rounded(most),
        "rate_limit": listed(np.minimum(RateLimits().rate_limit, reached)),
    }


def _feedback(
    second: np.ndarray, criteria: SimpleNamespace, share: float, fixed: dict
) -> dict[str, Any]:
    """Return lambda_1, lambda_2, Q and bias_gain of a law with theta_hat.

    Its gain on e is lambda_1 + Gamma p22, that on the integral of e Gamma p12 (docs/law.md); P is
    that of the whole gain on e.
    """
    whole = _law(criteria.feedback.stiffness * second**2, second, criteria, share, fixed)
    given = ("lambda_1", "lambda_2", "q_position", "q_velocity")
    _, p12, p22 = lyapunov_solution(*(np.array(whole[name]) for name in given))
    gamma = criteria.feedback.integral * second**3 / p12
    first = np.array(whole["lambda_1"]) - gamma * p22
    q_position = 2.0 * first * p12
    return whole | {
        "lambda_1": listed(first),
        "q_position": listed(q_position),
        "bias_gain": listed(gamma),
    }


def _law(
    first: np.ndarray, second: np.ndarray, criteria: SimpleNamespace, share: float, fixed: dict
) -> dict[str, Any]:
    """Return lambda_1, lambda_2 and Q of a law; share: of lambda_1 that adaptation adds at most.

    At its ceiling K0 adds K0 p12 / varpi to lambda_1; p12 = q_position / (2 lambda_1).
    """
    q_position = 2.0 * share * first**2 * fixed["varpi"] / fixed["k_ceiling"][0]
    return {
        "lambda_1": listed(first),
        "lambda_2": listed(second),
        "q_position": listed(q_position),
        "q_velocity": listed(criteria.adaptation.rate * q_position / first),
    }


def rounded(value: float) -> float:
    """Return `value` to DIGITS digits."""
    return float(f"{value:.{DIGITS}g}")


def listed(values: Sequence[float] | np.ndarray) -> list[float]:
    """Return `values` as a list of rounded numbers."""
    return [rounded(float(value)) for value in values]
