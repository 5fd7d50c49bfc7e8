"""Stage: inputs of the supervisor besides state and reference, read 50 times a second.

Messages arrive more often than the limits need them. This stage keeps the newest message of each
kind and reads it at the next reading. Ages are differences of stamps, so the delay of a message
has no effect.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from uam_control.ages import BRIDGED
from uam_control.estimation.pose_clock import PoseClock
from uam_control.maths.memory import Number, record
from uam_control.stamps import SECOND
from uam_control.supervision import Inputs, Readings

READ_PERIOD = 20_000_000  # [ns] of stamps between two readings
Kept = tuple[Callable[..., None], tuple, int]  # reader, its arguments, tick answered [ns]


class SupervisorInputs:
    """Keeps messages until the next reading; `readings`: of the last tick, see `Readings`;
    `clock`: of the poses."""

    _read_at = Number()

    def __init__(self, control_period: float) -> None:
        """control_period [s]: time between two ticks."""
        self.inputs = Inputs(control_period)
        self.readings = Readings()
        self.clock = PoseClock()
        self._kept: dict[str, list[Kept]] = {}
        self.memory = record("read_at")  # [ns] tick of the last reading
        self._read_at = -READ_PERIOD

    def keep(self, name: str, read: Callable[..., None], message: tuple, answers: int = -1) -> None:
        """Keep the newest message of `name`; the next reading calls read(*message).

        answers [ns]: the tick of which the message is a result. It is used from the next tick on:
        the message of another process may arrive before or after the reading of the same tick.
        """
        before = self._kept.get(name, ())
        # the one before it may be read at a tick that is too early for the newest
        self._kept[name] = [*before[-1:], (read, message, answers)]

    def newest(self) -> dict[str, tuple]:
        """Return the newest message of each name that is not read."""
        return {name: messages[-1][1] for name, messages in self._kept.items()}

    def forget(self) -> None:
        """Forget the messages that are not read."""
        self._kept.clear()

    def begin_anew(self) -> None:
        """Forget all values: stamps of a new simulation follow."""
        self.inputs.begin_anew()
        self.readings = Readings()
        self.clock = PoseClock()
        self.forget()

    def mocap(self, stamp: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Read a pose of `stamp` [ns]: position (3,) [m, ENU], quaternion (4,) [w x y z].

        One that does not count for its `PoseClock` is none: from the future, its age would never
        reach a limit; too late, or of a wrong clock, the estimate does not use it.
        """
        if self.clock(stamp / SECOND, self._read_at / SECOND, BRIDGED):
            self.inputs.mocap(stamp / SECOND, position, quaternion)

    def payload(self, stamp: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Read a pose of the payload's grip point, as `mocap` does."""
        self.inputs.payload(stamp / SECOND, position)

    def joints(
        self, stamp: int, alpha: np.ndarray, alpha_dot: np.ndarray, effort: np.ndarray
    ) -> None:
        """Read the joints at `stamp` [ns]; of alpha, alpha_dot, effort (n,) only effort [N m]."""
        self.inputs.joints(stamp / SECOND, effort)

    def tick(self, stamp: int) -> Readings:
        """Return the readings at the tick `stamp` [ns]; the next call reuses the object."""
        if stamp - self._read_at >= READ_PERIOD or stamp < self._read_at:
            self._read_at = stamp
            kept, self._kept = self._kept, {}
            for name, messages in kept.items():
                early = [one for one in messages if one[2] >= stamp]
                if early:
                    self._kept[name] = early
                if len(early) < len(messages):
                    read, message, _ = messages[-1 - len(early)]
                    read(*message)
        self.readings = self.inputs.at(stamp / SECOND)
        return self.readings
