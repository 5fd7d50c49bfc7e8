"""Digital filters on vectors, advanced by one sample per call."""

import math

import numpy as np

from uam_control.maths.compiled import jit

VALUE, RATE = range(2)  # rows of a second-order filter's state
ROUND = 2.0 * math.pi  # rad
# (bandwidth + velocity_weight / 2) × step of the joint observer: below 1 it is stable for all gains
LARGEST_GAIN = 0.8


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

    A step too long for these gains, as of a slow bus or after lost readings, would make the
    observer unstable. It is divided, and the reading followed back along its velocity.
    """
    steps = max(1, math.ceil((bandwidth + 0.5 * velocity_weight) * dt / LARGEST_GAIN - 1e-6))
    step = dt / steps
    for i in range(len(angle)):
        for left in range(steps - 1, -1, -1):
            reading = angle[i] - left * step * velocity[i] if left else angle[i]
            state[VALUE, i] += step * state[RATE, i]
            innovation = reading - state[VALUE, i]
            state[VALUE, i] += 2.0 * bandwidth * step * innovation
            state[RATE, i] += step * (
                bandwidth * bandwidth * innovation
                + velocity_weight * (velocity[i] - state[RATE, i])
            )


@jit
def observer_step(angle: np.ndarray, bandwidth: float, dt: float, state: np.ndarray) -> None:
    """Advance a tracking loop of the joints by dt [s], above 0, from encoder angles alone.

    angle (n,) [rad]: readings; state (2, n): estimated angle [rad] and velocity [rad/s]. The loop
    has two poles at bandwidth [Hz], damped by sqrt(1/2), mapped exactly to dt: it is stable with
    any. Its velocity is sqrt(2) / (2 pi bandwidth) - dt / 2 late. A reading that has gone round
    is followed on.
    """
    part = math.sqrt(0.5) * ROUND * bandwidth * dt
    decay = math.exp(-part)
    to_value = 1.0 - decay * decay
    to_rate = (1.0 + decay * decay - 2.0 * decay * math.cos(part)) / dt
    for i in range(len(angle)):
        state[VALUE, i] += dt * state[RATE, i]
        innovation = angle[i] - state[VALUE, i]
        innovation -= ROUND * np.rint(innovation / ROUND)
        state[VALUE, i] += to_value * innovation
        state[RATE, i] += to_rate * innovation
