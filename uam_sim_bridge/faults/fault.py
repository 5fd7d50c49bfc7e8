"""Base classes of faults: parameter sets with a name, a description and the place of action."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from uam_control.settings.parameter_set import ParameterSet
from uam_sim_bridge.plant import Samples

PLANT, LINK, PROCESS = "plant", "MAVLink", "process"


class FaultError(ValueError):
    """A fault that cannot be injected; the text is one line: what is wrong, what is allowed."""


@dataclass(frozen=True)
class Fault(ParameterSet):
    """Base of all faults. NAME: for the user; ABOUT: its effect; PLACE: PLANT, LINK or PROCESS."""

    NAME: ClassVar[str] = ""
    ABOUT: ClassVar[str] = ""
    PLACE: ClassVar[str] = ""

    @property
    def values(self) -> dict[str, Any]:
        """Return the parameters by name."""
        return asdict(self)


@dataclass
class PlantCommands:
    """Commands of a period: motors (n_rotors,) 0..1, effort (n_joints,) [N m], magnet on or off.

    The arrays are copies; an effect may change them.
    """

    motors: np.ndarray
    effort: np.ndarray
    magnet: bool


class Disturbable(Protocol):
    """The plant as an effect changes it; each call applies to the next period only."""

    period: float  # [s]

    def weaken_rotor(self, rotor: int, part: float) -> None:
        """Scale the thrust of rotor `rotor`, counted from 0, by `part` [1]."""

    def weaken_rotors(self, part: float) -> None:
        """Scale the thrust of all rotors by `part` [1]."""

    def brake_joint(self, joint: int, torque: float) -> None:
        """Add dry friction `torque` [N m] to joint `joint`, counted from 0."""

    def weaken_magnet(self, part: float) -> None:
        """Scale the magnet's holding force by `part` [1]."""

    def add_wind(self, wind: np.ndarray) -> None:
        """Add wind (3,) [m/s, ENU]."""

    def swing_payload(self, rate: float) -> None:
        """Attach the payload by a hinge while the magnet is on; rate [rad/s]: initial rate."""


class Effect:
    """Effect of a plant fault at each tick between its begin and end.

    The plant undoes the changes of `act` before the next tick. Effects therefore add up, and the
    end of a fault needs no code.
    """

    def sense(self, samples: Samples) -> None:
        """Change the samples of this tick. Replace the arrays, do not write into them."""

    def act(self, plant: Disturbable, commands: PlantCommands) -> None:
        """Change plant and commands for the next period."""


@dataclass(frozen=True)
class PlantFault(Fault):
    """A fault of sensors, actuators, payload or wind. PHYSICS: it needs `Plant.disturb`."""

    PLACE: ClassVar[str] = PLANT
    PHYSICS: ClassVar[bool] = False

    def effect(self, noise: np.random.Generator) -> Effect:
        """Return the effect that begins now; noise: generator of this fault, seeded per flight."""
        raise NotImplementedError
