"""Smooth, bounded references: chi_d, chi_d_dot, chi_d_ddot as functions of mission time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from uam_control.coordinates import ALPHA, CHI, CHI_DDOT, CHI_DOT, coordinates
from uam_control.maths.compiled import jit


class Trajectory(Protocol):
    """A reference as a function of mission time."""

    def write(self, time: float, reference: np.ndarray) -> None:
        """Write chi_d, chi_d_dot, chi_d_ddot at mission time [s] into reference (3, 6 + n)."""


@dataclass(frozen=True)
class Move:
    """Motion of one coordinate to `to` [m or rad] from time `start` to `end` [s], rest to rest."""

    coordinate: str
    start: float
    end: float
    to: float


class Moves:
    """Minimum-jerk moves from a starting pose; a coordinate holds its value between moves."""

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

    def write(self, time: float, reference: np.ndarray) -> None:
        """Write the reference (3, 6 + n); see `Trajectory.write`."""
        write_moves(time, self._start, self._rows, reference)


COORDINATE, START, END, FROM, TO = ROW = range(5)  # columns of the rows of moves


@jit
def write_moves(time: float, start: np.ndarray, rows: np.ndarray, reference: np.ndarray) -> None:
    """Write the reference (3, 6 + n) at mission time [s].

    start (6 + n,): chi at mission time 0; rows (m, 5), sorted by start: index of the coordinate,
    start [s], end [s], value at start, value at end.
    """
    reference[:] = 0.0
    reference[CHI] = start
    for row in rows:
        if time < row[START]:
            continue
        i, length, distance = int(row[COORDINATE]), row[END] - row[START], row[TO] - row[FROM]
        s = min((time - row[START]) / length, 1.0)
        reference[CHI, i] = row[FROM] + distance * s * s * s * (10.0 + s * (6.0 * s - 15.0))
        reference[CHI_DOT, i] = distance / length * 30.0 * s * s * (1.0 - s) * (1.0 - s)
        reference[CHI_DDOT, i] = (
            distance / (length * length) * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)
        )


class Sampled:
    """A sampled trajectory: cubic Hermite interpolation of values and rates, linear acceleration.

    times (m,) [s], increasing; samples (m, 3, 6 + n). Before the first and after the last sample
    the value is constant.
    """

    def __init__(self, times: np.ndarray, samples: np.ndarray) -> None:
        self._times = np.ascontiguousarray(times, dtype=float)
        self._samples = np.ascontiguousarray(samples, dtype=float)

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

    def write(self, time: float, reference: np.ndarray) -> None:
        """Write the reference (3, 6 + n); see `Trajectory.write`."""
        times, samples = self._times, self._samples
        reference[:] = 0.0
        if time <= times[0] or time >= times[-1]:
            reference[CHI] = samples[0 if time <= times[0] else -1, CHI]
            return
        row = int(np.searchsorted(times, time, side="right")) - 1
        length = times[row + 1] - times[row]
        s = (time - times[row]) / length
        (p0, v0, a0), (p1, v1, a1) = samples[row], samples[row + 1]
        reference[CHI] = (
            (2 * s**3 - 3 * s**2 + 1) * p0
            + (s**3 - 2 * s**2 + s) * length * v0
            + (-2 * s**3 + 3 * s**2) * p1
            + (s**3 - s**2) * length * v1
        )
        reference[CHI_DOT] = (
            (6 * s**2 - 6 * s) * (p0 - p1) / length
            + (3 * s**2 - 4 * s + 1) * v0
            + (3 * s**2 - 2 * s) * v1
        )
        reference[CHI_DDOT] = (1 - s) * a0 + s * a1


class Chain:
    """Successive trajectories; the time of each counts from its start."""

    def __init__(self, parts: list[tuple[float, Trajectory]]) -> None:
        """parts: (start in mission time [s], trajectory), in order."""
        self._parts = parts

    def write(self, time: float, reference: np.ndarray) -> None:
        """Write the reference (3, 6 + n); see `Trajectory.write`."""
        start, part = next((p for p in reversed(self._parts) if time >= p[0]), self._parts[0])
        part.write(time - start, reference)


def empty_reference(joints: int) -> np.ndarray:
    """Return a reference (3, 6 + joints) of zeros."""
    return np.zeros((3, ALPHA + joints))
