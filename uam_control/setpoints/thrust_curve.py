"""Thrust [N] ↔ normalised thrust of SET_ATTITUDE_TARGET.

Three curves lead from a thrust command s in 0..1 to the thrust T of a rotor:

    u      = solution of  m u^2 + (1 - m) u = s      autopilot (PX4: THR_MDL_FAC = m)
    T/Tmax = f u^2 + (1 - f) u                       motor and propeller (factor f)
    Tmax   = Tmax_full * battery                     full thrust at the present battery voltage

with u the motor command in 0..1. The bridge inverts the composition, so that T is correct for any
pair (f, m). For f = m the first two cancel and s = T / (Tmax_full * battery). For f = 0 the thrust
is proportional to the motor command, for f = 1 to its square.

All curves are strictly increasing on 0..1, so the inverse exists; inputs outside are clamped.
"""

import math

from uam_control.maths.compiled import borrowing


@borrowing
def curve(factor: float, u: float) -> float:
    """Return factor u^2 + (1 - factor) u, the relative thrust of command u in 0..1 (clamped)."""
    u = min(1.0, max(0.0, u))
    return factor * u * u + (1.0 - factor) * u


@borrowing
def inverse_curve(factor: float, relative_thrust: float) -> float:
    """Return u in 0..1 with curve(factor, u) = relative_thrust (clamped to 0..1)."""
    y = min(1.0, max(0.0, relative_thrust))
    b = 1.0 - factor
    # the root written without subtraction stays exact down to factor = 0
    denominator = b + math.sqrt(b * b + 4.0 * factor * y)
    return 2.0 * y / denominator if denominator > 0.0 else 0.0


@borrowing
def command_of_thrust(
    newtons: float, full_thrust: float, battery: float, motor_factor: float, model_factor: float
) -> float:
    """Return the normalised thrust s in 0..1 for a collective of `newtons` [N].

    full_thrust [N]: collective at u = 1 with a full battery; battery: present full thrust as a
    fraction of it; motor_factor: f; model_factor: m, THR_MDL_FAC.
    """
    u = inverse_curve(motor_factor, newtons / (full_thrust * battery))
    return curve(model_factor, u)


@borrowing
def thrust_of_command(
    command: float, full_thrust: float, battery: float, motor_factor: float, model_factor: float
) -> float:
    """Return the collective [N] of the normalised thrust `command`: the forward map."""
    u = inverse_curve(model_factor, command)
    return full_thrust * battery * curve(motor_factor, u)


@borrowing
def thrust_slope(
    command: float, full_thrust: float, battery: float, motor_factor: float, model_factor: float
) -> float:
    """Return d(newtons)/d(command) at `command`, clamped to 0..1 [N].

    It is `full_thrust * battery` everywhere for motor_factor = model_factor.
    """
    u = inverse_curve(model_factor, command)
    motor = 1.0 - motor_factor + 2.0 * motor_factor * u
    model = 1.0 - model_factor + 2.0 * model_factor * u
    # a factor of 1 has slope 0 at u = 0: a small floor keeps the ratio finite
    return full_thrust * battery * max(motor, 1e-3) / max(model, 1e-3)
