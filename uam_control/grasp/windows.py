"""Times and directions of grasp and release in a scenario, from its moves and its gripper."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np

AXES = "xyz"


class BaseMove(Protocol):
    """Motion of one coordinate from `start` to `end` [s] to the value `to`."""

    coordinate: str
    start: float
    end: float
    to: float


class Approach(NamedTuple):
    """How the tool comes to a payload: direction (3,) of its last way, a unit vector [world];
    point (3,) [m, world]: where it grips, from the middle of the payload's upper side."""

    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def from_above(self) -> bool:
        """Whether the tool comes straight down."""
        return self.direction == FROM_ABOVE.direction

    @property
    def axes(self) -> np.ndarray:
        """Rows (3, 3): two directions across, and the one back along the way; [world]."""
        back = -np.array(self.direction)
        if self.from_above:
            return np.eye(3)
        across = np.cross([0.0, 0.0, 1.0], back)
        side = across / np.linalg.norm(across) if np.any(across) else np.array([1.0, 0.0, 0.0])
        return np.array([side, np.cross(back, side), back])


FROM_ABOVE = Approach()


class GraspWindow(NamedTuple):
    """Mission times [s] of one payload."""

    descent: float  # begin of the last approach before the grip
    grip: float  # the gripper closes
    lifted: float  # end of the climb after it
    release: float  # it opens
    departure: float  # begin of the next motion, at most 1 s later
    back: tuple[float, float, float]  # [m] from the place of the grip to that of the begin
    approach: Approach = FROM_ABOVE


LONGEST_FALL = 1.0  # [s] after the release, for the verification


def grasp_windows(
    moves: Sequence[BaseMove],
    grips: Sequence[tuple[float, bool]],
    approaches: Mapping[float, Approach] | None = None,
) -> tuple[GraspWindow, ...]:
    """Return the windows of a scenario with moves and a gripper that closes (time [s], True).

    approaches: by the time of the grip; without one it is from above. A grip without such an
    approach before it and a climb after it has no window.
    """
    found = []
    switches = sorted(grips)
    for i, (grip, on) in enumerate(switches):
        if not on:
            continue
        release = next((at for at, still_on in switches[i + 1 :] if not still_on), math.inf)
        approach = (approaches or {}).get(grip, FROM_ABOVE)
        begin, back = _last_way(moves, grip, approach)
        level = [m.to for m in _of("z", moves) if m.end <= grip]
        after = [m for m in _of("z", moves) if grip <= m.start < release]
        if not (back and level and after) or after[0].to <= level[-1]:
            continue
        starts = [m.start for m in moves if m.start >= release]
        departure = min([*starts, release + LONGEST_FALL])
        found.append(GraspWindow(begin, grip, after[0].end, release, departure, back, approach))
    return tuple(found)


def _of(coordinate: str, moves: Sequence[BaseMove]) -> list[BaseMove]:
    return sorted((m for m in moves if m.coordinate == coordinate), key=lambda m: m.start)


def _last_way(
    moves: Sequence[BaseMove], grip: float, approach: Approach
) -> tuple[float, tuple[float, float, float] | None]:
    """Return begin [s] and way back (3,) [m] of the last moves before `grip` [s] along the
    approach; None without such moves."""
    begin, back = grip, [0.0, 0.0, 0.0]
    for axis, name in enumerate(AXES):
        if approach.direction[axis]:
            before = [m for m in _of(name, moves) if m.end <= grip]
            if len(before) < 2:
                return grip, None
            begin = min(begin, before[-1].start)
            back[axis] = before[-2].to - before[-1].to
    along = sum(a * b for a, b in zip(back, approach.direction, strict=True))
    return begin, (back[0], back[1], back[2]) if along < 0.0 else None
