"""The steps of the guided list, in order."""

from collections.abc import Sequence

from uam_lab.flights.vehicle.checklist_parameters import MotionLimits
from uam_lab.preflight.checklist.motion_step import JointTurn, MotionStep, Shift, Turn
from uam_lab.preflight.checklist.step import CONFIRM, Situation, Step, StepState

JOINT = "joint:"  # prefix of the steps of single joints
_LEVEL = "Bring it back to level and to the old heading."


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


def guided(joints: Sequence[str], limits: MotionLimits, magnet: bool = True) -> list[Step]:
    """Return the steps of a vehicle with these joints; magnet: whether it has one."""
    steps: list[Step] = [
        ConfirmStep(
            "hands_on",
            "Propellers off, radio switched on and in reach. Take the vehicle into your hands, "
            "then confirm.",
        ),
        MotionStep("tilt_roll", Turn(0, limits), (
            "Tilt the vehicle to the right: right side down, by 15 to 20 degrees. Keep it there.",
            "Tilt it to the left: left side down, by 15 to 20 degrees. Keep it there."),
            limits.tilt, _LEVEL),
        MotionStep("tilt_pitch", Turn(1, limits), (
            "Tilt the nose down, by 15 to 20 degrees. Keep it there.",
            "Tilt the nose up, by 15 to 20 degrees. Keep it there."), limits.tilt, _LEVEL),
        MotionStep("yaw_turn", Turn(2, limits), (
            "Turn the nose to the left, by 30 degrees, level. Keep it there.",),
            limits.turn, _LEVEL),
        MotionStep("move_forward", Shift(0, limits), (
            "Move the vehicle forward, along its nose, by 40 cm. Keep it there.",), limits.forward),
        MotionStep("lift", Shift(2, limits), (
            "Lift the vehicle by 30 cm. Keep it there.",), limits.lift),
    ]  # fmt: skip
    for index, name in enumerate(joints):
        text = f"Swing the link of {name} forward, by 15 to 20 degrees, by hand. Hold the other "
        text += "joints. Keep it there."
        turn = JointTurn(index, limits, joints)
        steps.append(MotionStep(JOINT + name, turn, (text,), limits.joint, "Bring the joint back."))
    if magnet:
        steps += [MagnetStep(True, limits), MagnetStep(False, limits)]
    return [
        *steps,
        KillStep(limits),
        ConfirmStep(
            "clear",
            "Put the vehicle down at its start, level, arm stowed. Propellers on. Everybody leaves "
            "the room. Then confirm.",
        ),
    ]
