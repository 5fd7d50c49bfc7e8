"""The gripper of a vehicle: an entry `magnet` or `gripper` of its file, or none.

`gripper` names a file of config/grippers, or a file, and may change its numbers. Its bodies are
hung on the vehicle's own: see `model_spec`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uam_control.settings import configuration
from uam_control.settings.section import Section, read_section

KINDS = NO_GRIPPER, MAGNET, TWO_FINGER = "none", "magnet", "two_finger"
TWO_ENTRIES = "the vehicle has a magnet, too: magnet: null leaves it out"
NEARLY = 0.1  # of a gripper's stroke: as near to its closed end, a command closes it
POSITIVE = (
    *("force", "speed", "friction", "transmission", "inertia", "stall_torque", "no_load_speed"),
    *("torque_per_current", "current_unit", "position_p_gain"),
)


@dataclass(frozen=True)
class Gripper:
    """What holds a payload."""

    kind: str = NO_GRIPPER  # one of KINDS
    opening: tuple[float, float] = (1.0, 0.0)  # closed, open [m]; of a magnet: on, off
    force: float = 0.0  # [N] limit of each finger, 0 without
    holding: float = 0.0  # [N] largest weight that it holds
    grip_depth: float = 0.0  # [m] of the tip below the payload's upper side, 0: on it

    @property
    def name(self) -> str:
        """Its name in texts."""
        return MAGNET if self.kind == MAGNET else "gripper"


def closes(opening: float, ends: tuple[float, float]) -> bool | None:
    """Return whether a command closes a gripper; None: outside of its ends, `Gripper.opening`."""
    closed, opened = ends
    if not min(ends) <= opening <= max(ends):
        return None
    return abs(opening - closed) <= NEARLY * abs(opened - closed)


class OpenEnd:
    """Where fingers that open come to: `opening` [m], as commanded until they close, else wide.

    commanded: whether there was a command.
    """

    def __init__(self, ends: tuple[float, float]) -> None:
        """ends: closed and open [m]."""
        self._ends, self._closed = ends, False
        self.opening, self.commanded = ends[1], False

    def command(self, opening: float) -> None:
        """Take a command; one that closes, or is refused, says nothing about the open end."""
        if closes(opening, self._ends) is False:
            self.opening, self.commanded = opening, True

    def switch(self, closed: bool) -> None:
        """Take whether the gripper is closed; with it the command is forgotten."""
        if closed and not self._closed:
            self.opening = self._ends[1]
        self._closed = closed


def gripper_of(numbers: dict[str, Any]) -> Gripper:
    """Return the gripper of a checked description's numbers."""
    if "magnet" in numbers:
        return Gripper(MAGNET, holding=numbers["magnet"]["holding_force"])
    if "gripper" not in numbers:
        return Gripper()
    g = numbers["gripper"]
    holding = 2.0 * g["friction"] * g["force"]
    return Gripper(TWO_FINGER, tuple(g["opening"]), g["force"], holding, g["grip_depth"])


def completed(document: dict[str, Any], file: Path, error: type[ValueError]) -> dict[str, Any]:
    """Return the content of a vehicle's file with the numbers of the gripper that it names."""
    top = Section(document, f"{file}:", error)
    if not top.has("gripper"):
        return document
    if document["gripper"] == NO_GRIPPER:
        if top.has("magnet"):
            raise top.error("gripper", f"{NO_GRIPPER}, but {TWO_ENTRIES}")
        return {key: value for key, value in document.items() if key != "gripper"}
    entry = top.section("gripper")
    given = configuration.beside(file, "grippers", entry.text("type"))
    source = configuration.named("grippers", given, suffixes=(".yaml",))
    usual = read_section(source, error).values
    found = usual | entry.values | {"model": str(source.parent / usual.get("model", ""))}
    return document | {"gripper": found}


def check_gripper(top: Section) -> None:
    """Raise the section's error if `gripper` is not usable."""
    if not top.has("gripper"):
        return
    g = top.section("gripper")
    if top.has("magnet"):
        raise top.error("gripper", TWO_ENTRIES)
    g.one_of("kind", (TWO_FINGER,))
    for name in ("type", "body"):
        g.text(name)
    g.text("instead_of", default="")
    g.numbers("position", 3)
    if not Path(g.text("model")).is_file():
        raise g.error("model", f"{g.values['model']} does not exist")
    for name in POSITIVE:
        g.positive(name)
    for name in ("mass", "grip_depth"):
        g.not_negative(name)
    closed, opened = g.numbers("opening", 2)
    if not 0.0 <= closed < opened:
        raise g.error("opening", f"{[closed, opened]}: closed and open in m, 0 <= closed < open")
