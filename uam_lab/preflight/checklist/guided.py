"""The steps of the guided list, in order."""

from __future__ import annotations

from collections.abc import Sequence

from uam_lab.preflight.checklist.limits import MotionLimits
from uam_lab.preflight.checklist.motion_kinds import JointTurn, Shift, Turn
from uam_lab.preflight.checklist.motion_step import MotionStep
from uam_lab.preflight.checklist.step import Step
from uam_lab.preflight.checklist.switch_steps import ConfirmStep, KillStep, MagnetStep

JOINT = "joint:"  # prefix of the steps of single joints
_LEVEL = "Bring it back to level and to the old heading."


class CommandedTurn(MotionStep):
    """A turn against which the control laws command body rates."""

    commands = True


class JointStep(MotionStep):
    """A turn of a joint whose servo has no torque."""

    arm_released = True


def guided(joints: Sequence[str], limits: MotionLimits, magnet: bool = True) -> list[Step]:
    """Return the steps of a vehicle with these joints; magnet: whether it has one."""
    steps: list[Step] = [
        ConfirmStep(
            "hands_on",
            "Propellers off, radio switched on and in reach. Take the vehicle into your hands, "
            "then confirm.",
        ),
        _turn("tilt_roll", 0, limits.tilt, limits, (
            "Tilt the vehicle to the right: right side down, by 15 to 20 degrees. Keep it there.",
            "Tilt it to the left: left side down, by 15 to 20 degrees. Keep it there.")),
        _turn("tilt_pitch", 1, limits.tilt, limits, (
            "Tilt the nose down, by 15 to 20 degrees. Keep it there.",
            "Tilt the nose up, by 15 to 20 degrees. Keep it there.")),
        _turn("yaw_turn", 2, limits.turn, limits, (
            "Turn the nose to the left, by 30 degrees, level. Keep it there.",)),
        _shift("move_forward", 0, limits.forward, limits,
               "Move the vehicle forward, along its nose, by 40 cm. Keep it there."),
        _shift("lift", 2, limits.lift, limits, "Lift the vehicle by 30 cm. Keep it there."),
    ]  # fmt: skip
    for index, name in enumerate(joints):
        steps.append(
            JointStep(
                JOINT + name,
                JointTurn(joints),
                index,
                [(1, f"Swing the link of {name} forward, by 15 to 20 degrees, by hand. Hold the "
                     "other joints. Keep it there.")],
                limits.joint,
                limits.still_angle,
                limits,
                back="Bring the joint back.",
            )
        )  # fmt: skip
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


def _turn(
    name: str, axis: int, least: float, limits: MotionLimits, texts: Sequence[str]
) -> CommandedTurn:
    targets = list(zip((1, -1), texts, strict=False))
    kind = Turn(axis, limits)
    return CommandedTurn(name, kind, axis, targets, least, limits.still_angle, limits, _LEVEL)


def _shift(name: str, axis: int, least: float, limits: MotionLimits, text: str) -> MotionStep:
    return MotionStep(
        name, Shift(), axis, [(1, text)], least, limits.still_position, limits, "Bring it back."
    )
