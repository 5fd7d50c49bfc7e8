"""Digital filters on vectors, advanced by one sample per call."""

from __future__ import annotations

import math

import numpy as np

from uam_control.maths.compiled import jit

VALUE, RATE = range(2)  # rows of a second-order filter's state


@jit
def derivative_step(
    value: np.ndarray, cutoff: float, dt: float, state: np.ndarray, derivative: np.ndarray
) -> None:
    """Differentiate value (n,) through a critically damped second-order low-pass at cutoff [Hz].

    state (2, n): filtered value and its rate, advanced exactly by dt [s]. The rate is also written
    into derivative (n,).
    """
    omega = 2.0 * math.pi * cutoff
    decay = math.exp(-omega * dt)
    for i in range(len(value)):
        offset = state[VALUE, i] - value[i]
        slope = state[RATE, i] + omega * offset
        state[VALUE, i] = value[i] + decay * (offset + slope * dt)
        state[RATE, i] = decay * (state[RATE, i] - omega * slope * dt)
        derivative[i] = state[RATE, i]


@jit
def low_pass_step(value: np.ndarray, cutoff: float, dt: float, state: np.ndarray) -> None:
    """Advance state (n,), first-order low-pass of value (n,) at cutoff [Hz], exactly by dt [s]."""
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
    """Advance a tracking observer of the joints by dt [s], from quantised encoder readings.

    angle (n,) [rad], velocity (n,) [rad/s]: readings. state (2, n): estimated angle and velocity.
    bandwidth [rad/s]: correction by the angle; velocity_weight [1/s]: by the velocity.
    """
    for i in range(len(angle)):
        state[VALUE, i] += dt * state[RATE, i]
        innovation = angle[i] - state[VALUE, i]
        state[VALUE, i] += 2.0 * bandwidth * dt * innovation
        state[RATE, i] += dt * (
            bandwidth * bandwidth * innovation + velocity_weight * (velocity[i] - state[RATE, i])
        )
