"""Tracking errors of the laws for the mission's status.

The desired attitude is the position law's, from /uam/position/command. At the end of a tick its
command may not have arrived yet, so the errors are those of the tick DELAY before: in lockstep its
messages have then arrived, and the same flight gives the same numbers. The messages stay
serialized; only the one that belongs to a status, twice a second, is read. Within a process
`note_desired` gives the desired attitude itself.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from uam_control.coordinates import ARM, ATTITUDE, CHI, POSITION
from uam_control.maths.rotations import tilt, wrap_angle
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import read_position_command
from uam_msgs_py.messages.layouts import BadMessage, stamp_of
from uam_msgs_py.node.base_node import UamNode

DELAY = 2  # ticks
STORED = 8  # messages and ticks


class Errors(NamedTuple):
    """Norms of estimate − reference, and the tilt."""

    position: float = 0.0  # [m] 0 while it is not controlled
    attitude: float = 0.0  # [rad] the same
    arm: float = 0.0  # [rad]
    tilt: float = 0.0  # [rad] angle between the vertical axes of body and world


class TrackingErrors:
    """Stores the newest ticks and commands; `newest` joins them by their stamps."""

    def __init__(self, node: UamNode) -> None:
        self._ticks: deque[tuple[int, np.ndarray, np.ndarray, bool]] = deque(maxlen=STORED)
        self._commands: deque[tuple[int, bytes | np.ndarray | None]] = deque(maxlen=STORED)
        node.listen(
            topics.POSITION_COMMAND,
            lambda data: self._commands.append((stamp_of(data), data)),
            required=False,
        )

    def note_desired(self, stamp: int, attitude: np.ndarray | None) -> None:
        """Store q_d (3,) [rad] of a tick, None while not flying, in place of its command."""
        self._commands.append((stamp, attitude))

    def tick(self, stamp: int, state: np.ndarray, reference: np.ndarray, flying: bool) -> None:
        """Store a tick: stamp [ns]; state, reference (3, 6 + n), see `coordinates`."""
        self._ticks.append((stamp, state[CHI].copy(), reference[CHI].copy(), flying))

    def newest(self) -> Errors:
        """Return the errors of the tick DELAY before the newest.

        Without the command of that tick the attitude error is 0.
        """
        if not self._ticks:
            return Errors()
        stamp, chi, chi_d, flying = self._ticks[max(len(self._ticks) - 1 - DELAY, 0)]
        position = attitude = 0.0
        if flying:
            position = float(np.linalg.norm(chi[POSITION] - chi_d[POSITION]))
            q_d = self._desired_attitude(stamp)
            if q_d is not None:
                attitude = float(np.linalg.norm(wrap_angle(chi[ATTITUDE] - q_d)))
        arm = float(np.linalg.norm(wrap_angle(chi[ARM] - chi_d[ARM])))
        return Errors(position, attitude, arm, tilt(chi[ATTITUDE]))

    def _desired_attitude(self, stamp: int) -> np.ndarray | None:
        """Return q_d (3,) [rad] of the command with this stamp [ns], None without one."""
        data = next((data for at, data in self._commands if at == stamp), None)
        if not isinstance(data, bytes):
            return data
        try:
            _, command = read_position_command(data)
        except BadMessage:  # the controllers, which act on it, report it
            return None
        return command.attitude[0] if command.flying else None
