"""Steps without a motion: confirmation, magnet, kill switch."""

from __future__ import annotations

from uam_lab.preflight.checklist.limits import MotionLimits
from uam_lab.preflight.checklist.step import CONFIRM, Situation, Step, StepState


class ConfirmStep(Step):
    """Passes when the person confirms."""

    def __init__(self, name: str, instruction: str) -> None:
        super().__init__(name, instruction, "confirmed", CONFIRM)


class MagnetStep(Step):
    """The magnet is switched; its driver reports the state, else the person hears the click."""

    def __init__(self, on: bool, limits: MotionLimits) -> None:
        word = "on" if on else "off"
        super().__init__(
            f"magnet_{word}",
            f"The magnet is switched {word}: listen for the click, hold a piece of iron to it.",
            f"{word} within {limits.magnet_time:.3g} s, or confirmed",
            "",
        )
        self.magnet, self._on, self._limits = on, on, limits
        self._begun = 0.0

    def begin(self, time: float) -> None:
        """Switch the magnet."""
        super().begin(time)
        self._begun, self.needs = time, ""

    def update(self, now: Situation) -> None:
        """Compare the reported state with the switched one."""
        if now.magnet is None:
            self.needs, self.seen = CONFIRM, "no state reported: confirm that it switched"
            return
        self.needs, self.seen = "", f"reported {'on' if now.magnet else 'off'}"
        if now.magnet is self._on:
            self._pass(now.time, self.seen)
        elif now.time - self._begun > self._limits.magnet_time:
            self._fail(now.time, f"{self.seen} {now.time - self._begun:.1f} s after the command")


class KillStep(Step):
    """The kill switch of the radio is engaged and released.

    PX4 reports it in its heartbeat. The person confirms where nothing of it is seen.
    """

    def __init__(self, limits: MotionLimits) -> None:
        super().__init__(
            "kill_switch",
            "Engage the kill switch of the radio for three seconds, then release it.",
            f"seen engaged for {limits.kill_time:.3g} s, then released; or confirmed",
            CONFIRM,
        )
        self._limits = limits
        self._since: float | None = None
        self._longest = 0.0

    def begin(self, time: float) -> None:
        """Wait for the switch."""
        super().begin(time)
        self._since, self._longest, self.needs = None, 0.0, CONFIRM

    def update(self, now: Situation) -> None:
        """Measure for how long the switch is engaged."""
        if now.killed:
            self._since = now.time if self._since is None else self._since
            self._longest = now.time - self._since
            self.needs, self.seen = "", f"engaged for {self._longest:.1f} s"
        elif self._since is None:
            self.seen = "not engaged" if now.killed is False else "not reported: confirm"
        elif self._longest >= self._limits.kill_time:
            self._pass(now.time, f"engaged for {self._longest:.1f} s, released")
        else:
            self._since, self.seen = None, f"engaged for {self._longest:.1f} s only"

    def confirm(self, time: float) -> str:
        """Refuse a confirmation while the switch is seen engaged."""
        if self._since is not None and self.state is StepState.ACTIVE:
            return "the kill switch is seen engaged: release it"
        return super().confirm(time)
