"""The autopilot's reasons for what it refuses or does, with advice."""

from __future__ import annotations

from uam_control.offboard.firmware import Firmware

KEPT = 5


class Reasons:
    """`told`: the reasons, newest last. Some texts of the firmware pass by themselves."""

    def __init__(self, spoken: Firmware) -> None:
        """spoken: whose texts they are."""
        self._firmware = spoken
        self.told: tuple[str, ...] = ()
        self._passing: dict[str, float] = {}  # reason that may pass → [s] since when

    def add(self, text: str) -> None:
        """Add a reason; one that was there becomes the newest."""
        text = self._firmware.with_advice(text)
        others = tuple(reason for reason in self.told if reason != text)
        self.told = (*others, text)[-KEPT:]

    def add_lasting(self, text: str, time: float, streaming: bool, delay: float) -> None:
        """Add a reason at `time` [s]; one that may pass only if it has lasted for `delay` [s].

        streaming: setpoints are streamed for long enough.
        """
        if self._firmware.passing(text, streaming):
            since = self._passing.setdefault(text, time)
            if time - since < delay:
                return
        self.add(text)

    def add_all(self) -> None:
        """Add also those that might have passed."""
        for earlier in self._passing:
            self.add(earlier)
        self._passing.clear()

    def forget(self) -> None:
        """Discard all: their cause is over."""
        self.told = ()
        self._passing.clear()
