"""What a fault is: a parameter set with a name, some words, and the place where it acts."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from uam_control.settings.parameter_set import ParameterSet
from uam_sim_bridge.plant import Samples

PLANT, LINK, PROCESS = "plant", "MAVLink", "process"


class FaultError(ValueError):
    """A fault that cannot be injected; the text is one line: what was wrong, what is allowed."""


@dataclass(frozen=True)
class Fault(ParameterSet):
    """Base of all faults. NAME: as the user calls it; ABOUT: what it does; PLACE: where it acts."""

    NAME: ClassVar[str] = ""
    ABOUT: ClassVar[str] = ""
    PLACE: ClassVar[str] = ""

    @property
    def values(self) -> dict[str, Any]:
        """Its parameters by name."""
        return asdict(self)


@dataclass
class PlantCommands:
    """What the plant is about to be told: motors (4,) 0..1, effort (2,) [N m], magnet's switch.

    The arrays are copies and may be changed.
    """

    motors: np.ndarray
    effort: np.ndarray
    magnet: bool


class Disturbable(Protocol):
    """What an effect can do to the plant; each call counts for the period that begins."""

    def weaken_rotors(self, parts: np.ndarray) -> None:
        """Scale the thrust of each rotor by parts (n_rotors,) [1]."""

    def brake_joint(self, joint: int, torque: float) -> None:
        """Add dry friction `torque` [N m] to joint number `joint` (from 0)."""

    def weaken_magnet(self, part: float) -> None:
        """Scale the magnet's holding force by `part` [1]."""

    def add_wind(self, wind: np.ndarray) -> None:
        """Add wind (3,) [m/s, ENU]."""

    def swing_payload(self, commands: PlantCommands, rate: float) -> None:
        """Hang the payload on a hinge while the magnet is on; rate [rad/s]: its first rate."""


class Effect:
    """What a fault of the plant does from its beginning to its end, tick by tick.

    Whatever it does to the plant in `act` is undone before the next tick; so effects add up, and
    an end needs no care.
    """

    def sense(self, samples: Samples) -> None:
        """Alter what arrives at this tick; the arrays in it are not to be written to."""

    def act(self, plant: Disturbable, commands: PlantCommands) -> None:
        """Alter plant and commands for the period that begins."""


@dataclass(frozen=True)
class PlantFault(Fault):
    """A fault of sensors, actuators, payload or air."""

    PLACE: ClassVar[str] = PLANT

    def effect(self, noise: np.random.Generator) -> Effect:
        """What begins now; noise: of this fault alone, seeded by the flight."""
        raise NotImplementedError
