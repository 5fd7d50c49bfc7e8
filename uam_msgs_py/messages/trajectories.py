"""NumPy arrays ↔ serialized JointTrajectory: references, states, commands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from uam_msgs_py.messages.layouts import BadMessage, Layout
from uam_msgs_py.messages.serialized import (
    Serialized,
    Template,
    all_finite,
    check_length,
    check_names,
    refuse_infinite,
)
from uam_msgs_py.messages.topics import WORLD


class TrajectoryWriter(Template):
    """Writes a JointTrajectory with one point: rows positions, velocities, accelerations, effort.

    `values`: row name → view (n,). Write to the views, then publish `stamped(stamp)`.
    """

    ROWS = ("positions", "velocities", "accelerations", "effort")

    def __init__(self, names: Sequence[str], rows: Sequence[str] = ROWS[:3], frame: str = WORLD):
        """names: of the n joints; rows: used rows, a subset of ROWS; frame: of the numbers."""
        point = JointTrajectoryPoint(**{row: [0.0] * len(names) for row in rows})
        super().__init__(JointTrajectory(joint_names=list(names), points=[point]), frame)

    def fill(self, stamp: int, state: np.ndarray, time_from_start: int = 0) -> bytes:
        """Return the message with state (3, n): positions, velocities, accelerations."""
        values = self.values
        values["positions"][:] = state[0]
        values["velocities"][:] = state[1]
        values["accelerations"][:] = state[2]
        return self.stamped(stamp, time_from_start)


class CommandWriter(TrajectoryWriter):
    """Writes a command, or no command: a JointTrajectory without names and points."""

    def __init__(self, names: Sequence[str], rows: Sequence[str], frame: str = WORLD):
        """See TrajectoryWriter."""
        super().__init__(names, rows, frame)
        self._idle = Template(JointTrajectory(), frame)

    def idle(self, stamp: int) -> bytes:
        """Return the message without a command at this stamp [ns]."""
        return self._idle.stamped(stamp)


class TrajectoryReader:
    """Reads `rows` of trajectories of the joints `names`.

    Adjacent rows have equal distances in the message, so one strided view covers all rows.
    """

    def __init__(self, names: Sequence[str], rows: Sequence[str] = TrajectoryWriter.ROWS[:3]):
        """names: of the n joints; rows: adjacent ones of TrajectoryWriter.ROWS."""
        self._names, self._rows = list(names), list(rows)

    def read(self, message: Serialized) -> np.ndarray:
        """Return a copy (rows, n) of the first point's rows.

        Raises BadMessage for other joint names, wrong lengths, not one point, or a number that is
        not finite.
        """
        checked = message.layout.checked.get(self)
        if checked is None:
            checked = message.layout.checked[self] = self._check(message.layout)
        shape, start, strides = checked
        values = np.ndarray(shape, "<f8", message.data, start, strides).copy()
        if not all_finite(values):
            for row, numbers in zip(self._rows, values, strict=True):
                refuse_infinite(row, numbers, self._names)
            raise BadMessage("overflow")
        return values

    def _check(self, layout: Layout) -> tuple[tuple[int, int], int, tuple[int, int]]:
        """Return shape, first byte and strides [bytes] of the rows; raises BadMessage."""
        names, rows = self._names, self._rows
        check_names(layout.names, names)
        if layout.points != 1:
            raise BadMessage(f"{layout.points} points, 1 expected")
        for row in rows:
            check_length(row, layout.length(row), names)
        starts = [layout.fields[row].start for row in rows]
        stride = starts[1] - starts[0] if len(starts) > 1 else 0
        return (len(rows), len(names)), starts[0], (stride, 8)
