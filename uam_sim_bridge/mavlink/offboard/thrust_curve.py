"""Newtons ↔ the normalised thrust of SET_ATTITUDE_TARGET.

Three curves stand between a thrust command s in 0..1 and the thrust of a rotor:

    u      = solution of  m u^2 + (1 - m) u = s      what the autopilot does (PX4: THR_MDL_FAC = m)
    T/Tmax = f u^2 + (1 - f) u                       the motor and its propeller (factor f)
    Tmax   = Tmax_full * battery                     what the battery leaves of the full thrust

with u the motor command in 0..1. The bridge inverts the composition, so that newtons are newtons
for any pair (f, m). For f = m the first two cancel and s = T / (Tmax_full * battery). f = 0 is a
motor with thrust proportional to its command, f = 1 one with thrust proportional to its square.

All curves are strictly increasing on 0..1, so the inverse exists; inputs outside are clamped.
"""

from __future__ import annotations

import math

from uam_control.maths.compiled import jit


@jit
def curve(factor: float, u: float) -> float:
    """Return factor u^2 + (1 - factor) u, the relative thrust of command u in 0..1 (clamped)."""
    u = min(1.0, max(0.0, u))
    return factor * u * u + (1.0 - factor) * u


@jit
def inverse_curve(factor: float, relative_thrust: float) -> float:
    """Return the u in 0..1 with curve(factor, u) = relative_thrust (clamped to 0..1)."""
    y = min(1.0, max(0.0, relative_thrust))
    b = 1.0 - factor
    # the root written without subtraction stays exact down to factor = 0
    denominator = b + math.sqrt(b * b + 4.0 * factor * y)
    return 2.0 * y / denominator if denominator > 0.0 else 0.0


@jit
def command_of_thrust(
    newtons: float, full_thrust: float, battery: float, motor_factor: float, model_factor: float
) -> float:
    """Return the normalised thrust s in 0..1 that makes `newtons`.

    newtons: desired collective thrust; full_thrust [N]: the collective at u = 1 with a full
    battery; battery: fraction of it that is left (1: full); motor_factor: f; model_factor:
    THR_MDL_FAC.
    """
    u = inverse_curve(motor_factor, newtons / (full_thrust * battery))
    return curve(model_factor, u)


@jit
def thrust_of_command(
    command: float, full_thrust: float, battery: float, motor_factor: float, model_factor: float
) -> float:
    """Return the collective [N] that the normalised thrust `command` makes: the forward map."""
    u = inverse_curve(model_factor, command)
    return full_thrust * battery * curve(motor_factor, u)


@jit
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
