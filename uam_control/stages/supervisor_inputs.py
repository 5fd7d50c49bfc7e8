"""Stage: what the supervisor is told besides state and reference, looked at 50 times a second.

Messages come more often than the limits need them. The newest of each kind is kept as it came and
read at a look. Ages go by stamps, so that the delay of a message does not matter.
"""

from __future__ import annotations

from collections.abc import Callable

from uam_control.stamps import seconds
from uam_control.supervision import Inputs, Readings

LOOK_PERIOD = 20_000_000  # [ns] of stamps between two looks


class SupervisorInputs:
    """Keeps messages until the next look; `readings`: as of the last tick, see `Readings`."""

    def __init__(self, control_period: float) -> None:
        """control_period [s]: of ticks."""
        self.inputs = Inputs(control_period)
        self.readings = Readings()
        self._kept: dict[str, tuple[Callable[..., None], tuple, int]] = {}
        self._looked = -LOOK_PERIOD

    def keep(self, name: str, read: Callable[..., None], message: tuple, answers: int = -1) -> None:
        """Keep the newest message of `name`; the next look calls read(*message).

        answers [ns]: the tick that the message answers. It counts from the tick after that one on,
        because another process may or may not be as fast as the look of that tick.
        """
        self._kept[name] = read, message, answers

    def tick(self, stamp: int) -> Readings:
        """Return what is known at the tick `stamp` [ns]; the object is reused."""
        if stamp - self._looked >= LOOK_PERIOD or stamp < self._looked:
            self._looked = stamp
            kept, self._kept = self._kept, {}
            for name, (read, message, answers) in kept.items():
                if answers >= stamp:
                    self._kept[name] = read, message, answers
                else:
                    read(*message)
        self.readings = self.inputs.at(seconds(stamp))
        return self.readings
