"""Smooth, bounded motions: chi_d and derivatives up to the snap as functions of mission time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.interpolate import make_interp_spline

from uam_control.coordinates import (
    ALPHA,
    CHI,
    CHI_DDOT,
    CHI_DOT,
    JERK,
    MOTION_ROWS,
    SNAP,
    coordinates,
)
from uam_control.maths.compiled import jit


class Trajectory(Protocol):
    """A motion as a function of mission time."""

    def write(self, time: float, motion: np.ndarray) -> None:
        """Write chi_d, chi_d_dot, chi_d_ddot, jerk and snap at mission time [s] into motion.

        motion (5, 6 + n): see `coordinates`; roll and pitch stay zero.
        """


@dataclass(frozen=True)
class Move:
    """Motion of one coordinate to `to` [m or rad] from time `start` to `end` [s], rest to rest."""

    coordinate: str
    start: float
    end: float
    to: float


class Moves:
    """Minimum-snap moves from a starting pose; a coordinate holds its value between moves."""

    def __init__(self, start: np.ndarray, moves: list[Move]) -> None:
        """start: chi (6 + n,) at mission time 0; moves of one coordinate must not overlap."""
        self._start = np.array(start, dtype=float)
        names = coordinates(len(self._start) - ALPHA)
        value = dict(zip(names, self._start, strict=True))
        rows = []
        for move in sorted(moves, key=lambda m: m.start):
            name = move.coordinate
            rows.append((names.index(name), move.start, move.end, value[name], move.to))
            value[name] = move.to
        self._rows = np.array(rows, dtype=float).reshape(-1, len(ROW))

    def write(self, time: float, motion: np.ndarray) -> None:
        """Write the motion (5, 6 + n); see `Trajectory.write`."""
        check_rows(motion)
        write_moves(time, self._start, self._rows, motion)


def check_rows(motion: np.ndarray) -> None:
    """Raise ValueError unless motion has five rows: compiled functions do not check bounds."""
    if len(motion) != MOTION_ROWS:
        raise ValueError(f"a motion has {MOTION_ROWS} rows, not {len(motion)}")


COORDINATE, START, END, FROM, TO = ROW = range(5)  # columns of the rows of moves


@jit
def write_moves(time: float, start: np.ndarray, rows: np.ndarray, motion: np.ndarray) -> None:
    """Write the motion (5, 6 + n) at mission time [s].

    start (6 + n,): chi at mission time 0; rows (m, 5), sorted by start: index of the coordinate,
    start [s], end [s], value at start, value at end. The polynomial of a move has degree seven:
    rate, acceleration and jerk are zero at both ends (least integral of the snap squared).
    """
    motion[:] = 0.0
    motion[CHI] = start
    for row in rows:
        if time < row[START]:
            continue
        i, length, distance = int(row[COORDINATE]), row[END] - row[START], row[TO] - row[FROM]
        s = min((time - row[START]) / length, 1.0)
        c = 1.0 - s
        per = distance
        motion[CHI, i] = row[FROM] + per * s**4 * (35.0 + s * (-84.0 + s * (70.0 - 20.0 * s)))
        per /= length
        motion[CHI_DOT, i] = per * 140.0 * (s * c) ** 3
        per /= length
        motion[CHI_DDOT, i] = per * 420.0 * (s * c) ** 2 * (1.0 - 2.0 * s)
        per /= length
        motion[JERK, i] = per * 840.0 * s * c * (1.0 + s * (-5.0 + 5.0 * s))
        per /= length
        inside = 1.0 if s < 1.0 else 0.0  # the snap of a move that has ended is zero
        motion[SNAP, i] = inside * per * 840.0 * (1.0 + s * (-12.0 + s * (30.0 - 20.0 * s)))


class Sampled:
    """A sampled trajectory, given by values, rates and accelerations at increasing times.

    The value is the cubic Hermite polynomial of values and rates. The acceleration is a quintic
    spline through the given accelerations; its derivatives are jerk and snap. So errors of rounding
    in the values do not appear in the derivatives. Before the first and after the last sample the
    value is constant.
    """

    def __init__(self, times: np.ndarray, samples: np.ndarray) -> None:
        """times (m,) [s], increasing, m at least 2; samples (m, 3, 6 + n): rows as a reference."""
        self._times = np.ascontiguousarray(times, dtype=float)
        self._samples = np.ascontiguousarray(samples, dtype=float)
        accelerations = self._samples[:, CHI_DDOT]
        degree = min(5, len(self._times) - 1)
        spline = make_interp_spline(self._times, accelerations, k=degree)
        # pieces of the polynomial between all samples, of which some are no knots of the spline
        self._pieces = np.stack([
            spline(self._times[:-1], order) / math.factorial(order) for order in range(degree + 1)
        ])  # fmt: skip

    @property
    def end(self) -> float:
        """Return the time of the last sample [s]."""
        return float(self._times[-1])

    @property
    def first(self) -> np.ndarray:
        """Return chi (6 + n,) of the first sample."""
        return self._samples[0, CHI]

    @property
    def last(self) -> np.ndarray:
        """Return chi (6 + n,) of the last sample."""
        return self._samples[-1, CHI]

    def write(self, time: float, motion: np.ndarray) -> None:
        """Write the motion (5, 6 + n); see `Trajectory.write`."""
        check_rows(motion)
        write_sample(time, self._times, self._samples, self._pieces, motion)


@jit
def write_sample(
    time: float, times: np.ndarray, samples: np.ndarray, pieces: np.ndarray, motion: np.ndarray
) -> None:
    """Write the motion (5, 6 + n) at time [s]; times (m,), samples (m, 3, 6 + n), see `Sampled`.

    pieces (d + 1, m - 1, 6 + n): coefficients of the accelerations after each sample, in powers of
    the time [s] since the sample, constant first.
    """
    motion[:] = 0.0
    if time <= times[0] or time >= times[-1]:
        motion[CHI] = samples[0 if time <= times[0] else -1, CHI]
        return
    k = int(np.searchsorted(times, time, side="right")) - 1
    length, h = times[k + 1] - times[k], time - times[k]
    s = h / length
    for i in range(motion.shape[1]):
        p0, v0 = samples[k, CHI, i], samples[k, CHI_DOT, i]
        p1, v1 = samples[k + 1, CHI, i], samples[k + 1, CHI_DOT, i]
        motion[CHI, i] = (
            (2 * s**3 - 3 * s**2 + 1) * p0
            + (s**3 - 2 * s**2 + s) * length * v0
            + (-2 * s**3 + 3 * s**2) * p1
            + (s**3 - s**2) * length * v1
        )
        motion[CHI_DOT, i] = (
            (6 * s**2 - 6 * s) * (p0 - p1) / length
            + (3 * s**2 - 4 * s + 1) * v0
            + (3 * s**2 - 2 * s) * v1
        )
        acceleration = jerk = snap = 0.0
        for order in range(pieces.shape[0] - 1, -1, -1):  # Horner, with two derivatives
            snap = snap * h + 2.0 * jerk
            jerk = jerk * h + acceleration
            acceleration = acceleration * h + pieces[order, k, i]
        motion[CHI_DDOT, i], motion[JERK, i], motion[SNAP, i] = acceleration, jerk, snap


class Chain:
    """Successive trajectories; the time of each counts from its start."""

    def __init__(self, parts: list[tuple[float, Trajectory]]) -> None:
        """parts: (start in mission time [s], trajectory), in order."""
        self._parts = parts

    def write(self, time: float, motion: np.ndarray) -> None:
        """Write the motion (5, 6 + n); see `Trajectory.write`."""
        start, part = next((p for p in reversed(self._parts) if time >= p[0]), self._parts[0])
        part.write(time - start, motion)


def empty_reference(joints: int) -> np.ndarray:
    """Return a reference (3, 6 + joints) of zeros."""
    return np.zeros((3, ALPHA + joints))


def empty_motion(joints: int) -> np.ndarray:
    """Return a motion (5, 6 + joints) of zeros."""
    return np.zeros((MOTION_ROWS, ALPHA + joints))
