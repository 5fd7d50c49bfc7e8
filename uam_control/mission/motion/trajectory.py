"""Smooth, bounded motions: chi_d and derivatives up to the snap as functions of mission time."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

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
from uam_control.maths.compiled import jit, prepared


class Trajectory(Protocol):
    """A motion as a function of mission time."""

    def write(self, time: float, motion: np.ndarray) -> None:
        """Write chi_d, chi_d_dot, chi_d_ddot, jerk and snap at mission time [s] into motion.

        motion (5, 6 + n): see `coordinates`; roll and pitch stay zero.
        """


@runtime_checkable
class Tabulated(Protocol):
    """A motion that writes many times in one call."""

    def rows(self, times: np.ndarray, count: int) -> np.ndarray:
        """Return the first `count` rows of the motion (count, m, 6 + n) at times (m,) [s]."""


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
        rows.sort(key=lambda row: row[COORDINATE])  # stable: of each coordinate by start
        self._rows = np.array(rows, dtype=float).reshape(-1, len(ROW))
        self._first = np.searchsorted(self._rows[:, COORDINATE], np.arange(len(names) + 1))
        self._write = prepared(write_moves, 0.0, self._start, self._first, self._rows, self._rows)

    def write(self, time: float, motion: np.ndarray) -> None:
        """Write the motion (5, 6 + n); see `Trajectory.write`."""
        check_rows(motion)
        self._write(time, self._start, self._first, self._rows, motion)

    def rows(self, times: np.ndarray, count: int = MOTION_ROWS) -> np.ndarray:
        """Return the first `count` rows of the motions (count, m, 6 + n) at times (m,) [s]."""
        motions = np.empty((len(times), MOTION_ROWS, len(self._start)))
        self.write_rows(times, motions)
        return motions.swapaxes(0, 1)[:count]

    def write_rows(self, times: np.ndarray, motions: np.ndarray) -> None:
        """Write the motions (m, 5, 6 + n) at mission times (m,) [s]."""
        _write_all(times, self._start, self._first, self._rows, motions)


def check_rows(motion: np.ndarray) -> None:
    """Raise ValueError unless motion has five rows: compiled functions do not check bounds."""
    if len(motion) != MOTION_ROWS:
        raise ValueError(f"a motion has {MOTION_ROWS} rows, not {len(motion)}")


COORDINATE, START, END, FROM, TO = ROW = range(5)  # columns of the rows of moves


@jit
def write_moves(
    time: float, start: np.ndarray, first: np.ndarray, rows: np.ndarray, motion: np.ndarray
) -> None:
    """Write the motion (5, 6 + n) at mission time [s].

    start (6 + n,): chi at mission time 0; rows (m, 5), sorted by coordinate and start: index of the
    coordinate, start [s], end [s], value at start, value at end; first (7 + n,): index of each
    coordinate's first row, and m. The newest move that has begun counts. Its polynomial has degree
    seven: rate, acceleration and jerk are zero at both ends (least integral of the snap squared).
    """
    motion[:] = 0.0
    motion[CHI] = start
    for i in range(len(start)):
        begun, later = first[i], first[i + 1]  # rows before `begun` have begun, from `later` not
        while begun < later:
            middle = (begun + later) // 2
            if rows[middle, START] <= time:
                begun = middle + 1
            else:
                later = middle
        if begun == first[i]:
            continue
        row = rows[begun - 1]
        length, distance = row[END] - row[START], row[TO] - row[FROM]
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


@jit
def _write_all(
    times: np.ndarray,
    start: np.ndarray,
    first: np.ndarray,
    rows: np.ndarray,
    motions: np.ndarray,
) -> None:
    """Write the motions (m, 5, 6 + n) at times (m,) [s]; see `write_moves`."""
    for i in range(len(times)):
        write_moves(times[i], start, first, rows, motions[i])


def empty_reference(joints: int) -> np.ndarray:
    """Return a reference (3, 6 + joints) of zeros."""
    return np.zeros((3, ALPHA + joints))


def empty_motion(joints: int) -> np.ndarray:
    """Return a motion (5, 6 + joints) of zeros."""
    return np.zeros((MOTION_ROWS, ALPHA + joints))


def reference_rows(trajectory: Trajectory, times: np.ndarray, joints: int) -> np.ndarray:
    """Return the reference (3, m, 6 + joints) of a trajectory at times (m,) [s]."""
    if isinstance(trajectory, Tabulated):
        return trajectory.rows(times, CHI_DDOT + 1)
    found = np.empty((len(times), *empty_motion(joints).shape))
    write_motions(trajectory, times, found)
    return found.swapaxes(0, 1)[: CHI_DDOT + 1]


def write_motions(trajectory: Trajectory, times: np.ndarray, motions: np.ndarray) -> None:
    """Write the motions (m, 5, 6 + n) of a trajectory at times (m,) [s]."""
    if isinstance(trajectory, Moves):
        trajectory.write_rows(times, motions)
        return
    for time, motion in zip(times.tolist(), motions, strict=True):
        trajectory.write(time, motion)
