"""Small digital filters on vectors."""

from __future__ import annotations

import math

import numpy as np

from uam_control.maths.compiled import jit


@jit
def derivative_step(
    value: np.ndarray, cutoff: float, dt: float, state: np.ndarray, derivative: np.ndarray
) -> None:
    """Differentiate value (n,) through a critically damped second-order low-pass at cutoff [Hz].

    state (2, n): filtered value and its rate, advanced exactly by dt; the rate goes to derivative.
    """
    omega = 2.0 * math.pi * cutoff
    decay = math.exp(-omega * dt)
    for i in range(len(value)):
        offset = state[0, i] - value[i]
        slope = state[1, i] + omega * offset
        state[0, i] = value[i] + decay * (offset + slope * dt)
        state[1, i] = decay * (state[1, i] - omega * slope * dt)
        derivative[i] = state[1, i]


@jit
def low_pass_step(value: np.ndarray, cutoff: float, dt: float, state: np.ndarray) -> None:
    """First-order low-pass of value (n,) at cutoff [Hz] into state (n,), exact over dt."""
    keep = math.exp(-2.0 * math.pi * cutoff * dt)
    for i in range(len(value)):
        state[i] = keep * state[i] + (1.0 - keep) * value[i]


@jit
def joint_step(
    angle: np.ndarray,
    velocity: np.ndarray,
    bandwidth: float,
    velocity_weight: float,
    dt: float,
    state: np.ndarray,
) -> None:
    """Tracking observer of joint angle and velocity from quantised encoder readings.

    state (2, n): angle [rad], velocity [rad/s]. bandwidth [rad/s] of the correction by the angle,
    velocity_weight [1/s] of that by the measured velocity.
    """
    for i in range(len(angle)):
        state[0, i] += dt * state[1, i]
        innovation = angle[i] - state[0, i]
        state[0, i] += 2.0 * bandwidth * dt * innovation
        state[1, i] += dt * (
            bandwidth * bandwidth * innovation + velocity_weight * (velocity[i] - state[1, i])
        )
