"""Fit of torque constant, Coulomb and viscous friction of a joint by least squares.

The motor's torque is s u: u as the driver reads it (current x the constant of the hardware file),
s the unknown scale. It carries weight, inertia and friction:

    s u = G(alpha) + J alpha'' + c sign(alpha') + d alpha' + b

Divided by s this is linear in 1/s, J/s, c/s, d/s and b/s. Only a known weight G reveals s: hang a
load if the arm alone is too light. Samples slower than SLOWEST, and those whose smoothing contains
such a sample, are left out: there the friction is stiction, and the acceleration has steps.
"""

import math
from dataclasses import dataclass

import numpy as np

from uam_sim_bridge.devices.dynamixel.excitation import Record

SLOWEST = 0.15  # [rad/s]
WINDOW = 0.2  # [s] of the smoothing
LEAST = 200  # samples
SCALE_UNCERTAIN = 0.05  # relative; beyond it the scale is not used


class FitError(ValueError):
    """The record does not determine the parameters; the text is one line."""


@dataclass(frozen=True)
class FrictionFit:
    """Result of a fit, with standard deviations."""

    scale: float  # [1] true torque constant / that of the hardware file
    coulomb: float  # [N m]
    viscous: float  # [N m s/rad]
    inertia: float  # [kg m^2]
    scale_deviation: float
    coulomb_deviation: float
    viscous_deviation: float
    residual: float  # [N m] standard deviation of the torque
    scale_known: bool  # whether the weight was large enough, else scale is 1
    velocity: np.ndarray  # (m,) used samples, for the picture
    torque: np.ndarray  # (m,) of them, without weight and inertia


def fit_friction(record: Record, joint: int, weight: np.ndarray) -> FrictionFit:
    """Fit one joint; weight (m,) [N m]: G at each sample. Raises FitError."""
    times, angle = _uniform(record.times, record.position[:, joint])
    effort = np.interp(times, record.times, record.effort[:, joint])
    load = np.interp(times, record.times, weight)
    if len(times) < LEAST:
        raise FitError(f"{len(times)} samples, {LEAST} needed: a longer duration")
    step = times[1] - times[0]
    half = max(3, round(0.5 * WINDOW / step))
    # one filter for all: what is linear in the torque stays so
    angle, effort, load = (_smoothed(values, half) for values in (angle, effort, load))
    velocity = np.gradient(angle, step)
    acceleration = np.gradient(velocity, step)
    slow = (np.abs(velocity) <= SLOWEST).astype(float)
    moving = np.convolve(slow, np.ones(2 * half + 1), mode="same") < 0.5
    if np.count_nonzero(moving) < LEAST or not _both_ways(velocity[moving]):
        raise FitError(
            f"too little motion faster than {SLOWEST:g} rad/s in both directions: a larger "
            "amplitude or frequency"
        )
    velocity, acceleration = velocity[moving], acceleration[moving]
    effort, load = effort[moving], load[moving]
    others = [acceleration, np.sign(velocity), velocity, np.ones(len(velocity))]
    found, deviations, residual = _least_squares([load, *others], effort)
    known = found[0] > 0.0 and deviations[0] < SCALE_UNCERTAIN * found[0]
    if known:
        scale, rest, spread = 1.0 / found[0], found[1:], deviations[1:]
        scale_deviation = scale * deviations[0] / found[0]
    else:
        rest, spread, residual = _least_squares(others, effort - load)
        scale, scale_deviation = 1.0, math.nan
    inertia, coulomb, viscous, offset = scale * rest
    return FrictionFit(
        scale=scale,
        coulomb=float(coulomb),
        viscous=float(viscous),
        inertia=float(inertia),
        scale_deviation=float(scale_deviation),
        coulomb_deviation=float(scale * spread[1]),
        viscous_deviation=float(scale * spread[2]),
        residual=float(scale * residual),
        scale_known=bool(known),
        velocity=velocity,
        torque=scale * effort - load - inertia * acceleration - offset,
    )


def _uniform(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return equidistant times [s] and the values there."""
    if len(times) < 2 or times[-1] <= times[0]:
        raise FitError("no samples")
    grid = np.linspace(times[0], times[-1], len(times))
    return grid, np.interp(grid, times, values)


def _smoothed(values: np.ndarray, half: int) -> np.ndarray:
    """Return the samples that have `half` neighbours, smoothed by three boxes (a spline)."""
    box = np.ones(2 * (half // 3) + 1)
    kernel = np.convolve(np.convolve(box, box), box)
    return np.convolve(values, kernel / kernel.sum(), mode="valid")


def _both_ways(velocity: np.ndarray) -> bool:
    share = np.count_nonzero(velocity > 0.0) / len(velocity)
    return 0.2 < share < 0.8


def _least_squares(
    columns: list[np.ndarray], values: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return coefficients, their standard deviations, and that of a sample.

    The residual of friction is correlated over about a window: so many samples count as one.
    """
    matrix = np.column_stack(columns)
    found, _, rank, _ = np.linalg.lstsq(matrix, values, rcond=None)
    if rank < matrix.shape[1]:
        if rank == matrix.shape[1] - 1 and not np.any(columns[0]):  # no weight at all
            found = found.copy()
        else:
            raise FitError("the motion does not tell the parameters apart: a larger amplitude")
    residual = float(np.sqrt(np.mean((values - matrix @ found) ** 2)))
    inverse = np.linalg.pinv(matrix.T @ matrix)
    correlated = 10.0
    deviations = residual * np.sqrt(correlated * np.diag(inverse))
    return found, deviations, residual
