"""What a controller computes around its law at a tick: one compiled call before it, one after it.

The steps themselves are in `tracking_errors`, `output_limits`, `arm_load`, `thrust_direction`, but
for a lead for rotors that lag: with it the thrust follows the position law's force faster than they
do. The thrust f follows its command c as lag f' = c - f. With

    c = f + lag / response (u - f)

it follows the force u as response f' = u - f. f is modelled from the commands as they were limited,
so that a limit leaves no error behind. All of the force is scaled, so that its direction stays, and
with it the desired attitude.
"""

import math
from typing import NamedTuple

import numpy as np

from uam_control.arm.still_joint import stands
from uam_control.control.arm_load import ArmLoad, arm_load
from uam_control.control.output_limits import (
    LONGEST_PREDICTION,
    ForceCompletion,
    complete_and_limit,
    integrate,
    limit_torque,
    turn_level,
    wash_out,
)
from uam_control.control.sample_hold import is_new
from uam_control.control.thrust_direction import attitude_reference_step
from uam_control.coordinates import ALPHA, CHI, CHI_DDOT, CHI_DOT, ROLL, YAW, X, Z
from uam_control.laws.errors import E_DOT, FEEDFORWARD, E, tracking_errors
from uam_control.laws.law import LawInputs
from uam_control.maths.compiled import borrowing, inlined

# saturated: whether a limit changed the output of the last tick; flying: whether the law has begun;
# printed: form of the errors' rates; frozen: see `Law`; time [s]: counted for the goals of servos
WHOLE, REAL = "saturated flying printed frozen", "time"


class RotorLead(NamedTuple):
    """See above."""

    lag: float  # [s]
    response: float  # [s]; 0: no lead
    made: np.ndarray  # (1,) [N] upward part of f, NaN at first: then it is u


@borrowing
def lead_force(lead: RotorLead, least: float, largest: float, dt: float, tau: np.ndarray) -> bool:
    """Scale the force tau (3,) [N, ENU] by the lead, in place; return whether a limit acted.

    least [N], above 0: smallest tau[Z], which tau has, too; largest [N]: of ||tau||; dt [s].
    """
    if lead.response <= 0.0:
        return False
    upward, made = tau[Z], lead.made[0]
    if math.isnan(made):
        made = upward
    length = math.sqrt(tau[0] * tau[0] + tau[1] * tau[1] + tau[2] * tau[2])
    wanted = made + lead.lag / lead.response * (upward - made)
    given = max(least, min(wanted, upward * largest / length))
    for i in range(X, Z + 1):
        tau[i] *= given / upward
    lead.made[0] = made + (1.0 - math.exp(-dt / lead.lag)) * (given - made)
    return given != wanted


class ControllerArrays(NamedTuple):
    """Of every controller, the same for all laws."""

    found: np.ndarray  # (m,) tau of the law
    errors: np.ndarray  # (3, 6 + n) see `tracking_errors`
    own: tuple[np.ndarray, np.ndarray, np.ndarray]  # rows of the subsystem in them
    norms: np.ndarray  # (3,)
    tau: np.ndarray  # (m,) limited output
    numbers: np.ndarray  # (1,) WHOLE, REAL


class PositionArrays(NamedTuple):
    """Of the `PositionController`."""

    all: ControllerArrays
    completion: ForceCompletion
    carried: tuple[np.ndarray, np.ndarray]  # [m/s^2] bias (3,) of the law, integral (3,)
    rotors: RotorLead  # lead for their lag
    turning: bool  # whether the bias turns with the heading
    cutoff: float
    filter: np.ndarray  # see `attitude_reference_step`
    lead: np.ndarray  # the same
    attitude: np.ndarray  # the same


# [s] loop delay, time ahead for which the errors are predicted; the others: parameters
PREDICTION = "measured ahead prediction nominal"


class AttitudeArrays(NamedTuple):
    """Of the `AttitudeController`."""

    all: ControllerArrays
    load: ArmLoad
    turn: np.ndarray  # (3,) [rad/s^2] moment of the load per inertia
    inertia: np.ndarray  # (3,) [kg m^2]
    washout: np.ndarray  # see `wash_out`
    slow: np.ndarray  # (3,) see `wash_out`
    rates: int  # number in RATE_REFERENCES
    measured: bool  # whether the load is that of the measured angles
    torque_max: np.ndarray
    prediction: np.ndarray  # (1,) PREDICTION, and whether the delay counts


class ArmArrays(NamedTuple):
    """Of the `ArmController`."""

    all: ControllerArrays
    load: ArmLoad
    inertia: np.ndarray  # (n,) [kg m^2]; the next three: see `integrate`
    gain: np.ndarray
    limit: float
    integral: np.ndarray
    torque_max: np.ndarray
    command: np.ndarray  # (n,) given goals: of reference or state, plus compliance tau
    goals: bool
    of_reference: bool
    compliance: float  # [rad/(N m)]
    hold: np.ndarray  # (1,) when, see `is_new`
    still: np.ndarray  # (n,) see `let_go`


@borrowing
def begin_law(
    a: ControllerArrays,
    state: np.ndarray,
    reference: np.ndarray,
    attitude_reference: np.ndarray,
    flying: bool,
) -> None:
    """Write the errors of a law: see `tracking_errors`."""
    printed = a.numbers[0].printed != 0
    tracking_errors(state, reference, attitude_reference, flying, printed, a.errors, a.norms)


@inlined
def given(a: ControllerArrays, dt: float) -> LawInputs:
    """Return what the law gets after a step of dt [s]."""
    m = a.numbers[0]
    return LawInputs(*a.own, a.norms, m.saturated != 0, m.frozen != 0, dt)


@borrowing
def begin_attitude(
    a: AttitudeArrays,
    state: np.ndarray,
    reference: np.ndarray,
    attitude_reference: np.ndarray,
    dt: float,
) -> None:
    """Write the errors of the attitude law: tracking errors, arm's moment, prediction.

    The desired body rates of roll and pitch move with their feedforward, e_q with its rate. The
    measured body rates stay: they cancel in the setpoint. Yaw stays as it is: the rotors' weak
    moment about yaw leaves no room for more gain on its rate (docs/tuning.md).
    """
    begin_law(a.all, state, reference, attitude_reference, True)
    errors, ahead = a.all.errors, a.prediction[0].ahead
    if a.rates > 0:
        planned = 1.0 if a.rates == 1 else 0.0
        for i in range(ROLL, ALPHA):
            errors[E_DOT, i] = state[CHI_DOT, i] - planned * reference[CHI_DOT, i]
            errors[FEEDFORWARD, i] = planned * reference[CHI_DDOT, i]
    if a.load.on:
        # the law's own inertia, that of vehicle and arm, has the angular acceleration already
        angles = state[CHI, ALPHA:] if a.measured else reference[CHI, ALPHA:]
        moment = arm_load(a.load, reference, angles, False)
        for i in range(3):
            a.turn[i] = moment[i] / a.inertia[i]
    for i in range(ROLL, YAW):
        errors[E, i] += ahead * errors[E_DOT, i]
        errors[E_DOT, i] -= ahead * errors[FEEDFORWARD, i]
    for i in range(len(a.turn)):
        errors[FEEDFORWARD, ROLL + i] += a.turn[i]
    wash_out(errors[FEEDFORWARD, ROLL:ALPHA], a.washout, dt, a.slow)


@borrowing
def predict_by(prediction: np.ndarray, loop_delay: float) -> None:
    """Use the measured `loop_delay` [s], from a setpoint to the gyro's response; NaN: unknown.

    prediction (1,): of `AttitudeArrays`. The delay beyond the nominal one is added to it.
    """
    p = prediction[0]
    p.measured, p.ahead = loop_delay, p.prediction
    if p.counts and math.isfinite(loop_delay):
        p.ahead = min(LONGEST_PREDICTION, p.prediction + max(0.0, loop_delay - p.nominal))


@borrowing
def let_go(a: ArmArrays, state: np.ndarray, reference: np.ndarray) -> None:
    """Take the errors from a joint while its reading contradicts its torque, see `stands`.

    It keeps its known load and its theta_hat, which do not wind up on a wrong angle.
    """
    of = a.all
    for i in range(len(a.still)):
        angle, wanted = state[CHI, ALPHA + i], reference[CHI, ALPHA + i]
        torque, known = of.tau[i], a.load.torques[i]
        if stands(a.still, i, angle, wanted, torque, known, a.torque_max[i], 1.0):
            of.errors[E, ALPHA + i] = of.errors[E_DOT, ALPHA + i] = 0.0


@borrowing
def end_position(a: PositionArrays, reference: np.ndarray, dt: float) -> None:
    """Complete the law's force and limit it; then write the desired attitude.

    See `complete_and_limit`, `lead_force` and `attitude_reference_step`. The bias of the next tick
    turns with the reference's heading: about the vertical body rates and rates of the heading
    differ by the tilt.
    """
    m, tau = a.all.numbers[0], a.all.tau
    saturated, e, found = m.saturated != 0, a.all.own[E], a.all.found
    limits = a.completion
    cut = complete_and_limit(reference, e, limits, saturated, dt, a.carried, found, tau)
    led = lead_force(a.rotors, limits.thrust_min, limits.thrust_max, dt, tau)
    m.saturated = cut or led
    attitude_reference_step(tau, reference, a.cutoff, dt, a.filter, a.lead, a.attitude)
    if a.turning and m.frozen == 0:
        turn_level(reference[CHI_DOT, YAW] * dt, a.carried[0])


@borrowing
def end_attitude(a: AttitudeArrays) -> None:
    """Limit the law's torques: see `limit_torque`."""
    a.all.numbers[0].saturated = limit_torque(a.all.found, a.torque_max, a.all.tau)


@borrowing
def end_arm(a: ArmArrays, state: np.ndarray, reference: np.ndarray, dt: float) -> None:
    """Complete the law's torques and limit them; then write goals of the servos if they are due."""
    m, errors, tau = a.all.numbers[0], a.all.errors, a.all.found
    integrate(errors[E, ALPHA:], a.gain, a.limit, m.saturated != 0, dt, a.integral)
    for i in range(len(tau)):
        tau[i] -= a.inertia[i] * a.integral[i]
    if a.load.on:  # the known load takes the place of the law's feedforward
        arm_load(a.load, reference, reference[CHI, ALPHA:], True)
        for i in range(len(tau)):
            tau[i] += a.load.torques[i] - a.inertia[i] * errors[FEEDFORWARD, ALPHA + i]
    m.saturated = limit_torque(tau, a.torque_max, a.all.tau)
    command_goals(a, state, reference, dt)


@borrowing
def command_goals(a: ArmArrays, state: np.ndarray, reference: np.ndarray, dt: float) -> None:
    """Write goals of the servos for the limited torques, if they take goals and these are due."""
    m = a.all.numbers[0]
    if not a.goals:
        return
    m.time += dt
    if is_new(a.hold, m.time):
        base = reference if a.of_reference else state
        for i in range(len(a.command)):
            a.command[i] = base[CHI, ALPHA + i] + a.compliance * a.all.tau[i]
