"""Axes and buttons → velocities of the hand, gripper, hold; the mapping is a file in config/teleop.

The dead-man button must be held for everything but the hold. Keys of a terminal are axes and
buttons, too: each counts as held for a while, with the dead-man button.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uam_control.settings import configuration
from uam_control.settings.section import Section, read_section

FOLDER, DEFAULT = "teleop", "gamepad"
FRAMES = ("world", "end_effector")
AXES, NAMES = ("linear", "angular"), "xyz"
MOST = 64  # axes and buttons


class MappingError(ValueError):
    """A mapping that cannot be used; the text is one line: where, what is wrong, what is allowed"""


@dataclass(frozen=True)
class Mapping:
    """What axes, buttons and keys mean."""

    frame: str  # of FRAMES
    dead_man: int  # button
    hold: int  # button
    rate: float  # [Hz]
    silent_after: float  # [s]
    dead_zone: float
    axes: dict[int, tuple[int, float]]  # axis and its share of the limit, by row of the twist
    gripper: dict[int, float]  # value by button
    key_time: float  # [s]
    keys: dict[str, tuple[bool, int, float]]  # whether an axis, its number, value; by key

    @classmethod
    def read(cls, name: str) -> Mapping:
        """Return the mapping of a name in config/teleop, or of a file. Raises MappingError."""
        try:
            file = configuration.named(FOLDER, name)
        except configuration.ConfigurationError as error:
            raise MappingError(str(error)) from None
        one = read_section(Path(file), MappingError)
        axes, gripper = {}, {}
        for entry in one.entries("gripper", True):
            gripper[_number(entry, "button")] = entry.number("value")
            entry.only_asked()
        for row, key in enumerate(AXES):
            part = one.section(key)
            part.only(NAMES)
            for column, letter in enumerate(NAMES):
                if part.has(letter):
                    entry = part.section(letter)
                    axes[3 * row + column] = _number(entry, "axis"), _share(entry)
                    entry.only_asked()
        pad = one.section("keys")
        found = cls(
            *(one.one_of("frame", FRAMES), _number(one, "dead_man"), _number(one, "hold")),
            *(one.positive("rate"), one.positive("silent_after"), one.not_negative("dead_zone")),
            *(axes, gripper, one.positive("key_time")),
            {key: _key(pad.section(key)) for key in pad.values},
        )
        one.only_asked()
        return found


def _number(section: Section, key: str) -> int:
    return section.whole(key, 0, MOST - 1)


def _share(entry: Section) -> float:
    value = entry.number("share", default=1.0)
    if abs(value) > 1.0:
        raise entry.error("share", f"{value:g} is not within -1..1")
    return value


def _key(entry: Section) -> tuple[bool, int, float]:
    axis = entry.has("axis")
    found = axis, _number(entry, "axis" if axis else "button"), entry.number("value", default=1.0)
    entry.only_asked()
    return found


class Gamepad:
    """Reads axes and buttons; a button acts once, when it is pressed."""

    def __init__(self, mapping: Mapping) -> None:
        self._mapping = mapping
        self._axes: Sequence[float] = ()  # while the dead-man button is held
        self._pressed: set[int] = set()
        self._moving = False

    def read(self, axes: Sequence[float], buttons: Sequence[int]) -> tuple[bool, float | None]:
        """Take axes (-1..1) and buttons (0, 1); return whether to hold, and a new gripper value.

        Raises ValueError, and stops, for axes or buttons that the mapping needs and that are not
        there, or not finite.
        """
        m = self._mapping
        self.silence()
        needed = max((number for number, _ in m.axes.values()), default=-1)
        last = max((m.dead_man, m.hold, *m.gripper))
        if len(axes) <= needed or len(buttons) <= last:
            raise ValueError(
                f"{len(axes)} axes and {len(buttons)} buttons, the mapping needs {needed + 1} and "
                f"{last + 1}"
            )
        if not all(map(math.isfinite, axes)):
            raise ValueError("an axis is not finite")
        down = {number for number, value in enumerate(buttons) if value}
        new, self._pressed = down - self._pressed, down
        held = m.dead_man in down
        self._axes = axes if held else ()
        gripper = next((m.gripper[number] for number in new if held and number in m.gripper), None)
        return m.hold in new, gripper

    def silence(self) -> None:
        """Ask for no motion until the next `read`."""
        self._axes = ()

    def twist(self, limits: Sequence[float]) -> np.ndarray | None:
        """Return linear [m/s] and angular velocity [rad/s] (6,), None for nothing to send.

        limits: speed [m/s] and turn rate [rad/s] at the end of an axis. Zeros end a motion, once.
        """
        twist = np.zeros(6)
        for row, (number, share) in self._mapping.axes.items() if len(self._axes) else ():
            value = min(1.0, max(-1.0, self._axes[number]))
            twist[row] = limits[row // 3] * share * value * (abs(value) > self._mapping.dead_zone)
        before, self._moving = self._moving, bool(twist.any())
        return twist if self._moving or before else None


class Keys:
    """Axes and buttons of a keyboard without a release of its keys."""

    def __init__(self, mapping: Mapping) -> None:
        self._mapping = mapping
        self._until: dict[str, float] = {}

    def press(self, key: str, now: float) -> bool:
        """Take a key at `now` [s]; return whether it is one of the mapping."""
        known = key in self._mapping.keys
        if known:
            self._until.pop(key, None)  # the newest key of an axis counts
            self._until[key] = now + self._mapping.key_time
        return known

    def state(self, now: float) -> tuple[list[float], list[int]]:
        """Return axes and buttons at `now` [s]."""
        axes, buttons = [0.0] * MOST, [0] * MOST
        for key, until in self._until.items():
            if now < until:
                is_axis, number, value = self._mapping.keys[key]
                if is_axis:
                    axes[number] = value
                else:
                    buttons[number] = 1
                buttons[self._mapping.dead_man] = 1
        return axes, buttons
