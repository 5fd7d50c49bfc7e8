"""Base classes of faults: parameter sets with a name, a description and the place of action.

A fault is a subclass of the base of its kind. Its fields are its parameters, its docstring is the
description for the user, and its name is that of the class: `MotorLoss` is `motor_loss`.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, dataclass_transform

import numpy as np

from uam_control.settings.parameter_set import NamedSet, choice, integer, number
from uam_sim_bridge.plant import Disturbance, Samples

PLANT, LINK, PROCESS, CABLE = "plant", "MAVLink", "process", "cable"


class FaultError(ValueError):
    """A fault that cannot be injected; the text is one line: what is wrong, what is allowed."""


@dataclass_transform(frozen_default=True, field_specifiers=(integer, number, choice))
class Fault(NamedSet):
    """Base of all faults. PLACE: PLANT, LINK, PROCESS or CABLE."""

    PLACE: ClassVar[str] = ""


@dataclass
class PlantCommands:
    """Commands of a period. The arrays are copies; a fault may change them."""

    motors: np.ndarray  # (n_rotors,) 0..1
    effort: np.ndarray  # (n_joints,) [N m]
    magnet: bool  # on or off


@dataclass
class Occurrence:
    """A fault of the plant between its begin and its end."""

    noise: np.random.Generator  # of this fault, seeded per flight
    begun: int = 0  # tick of the begin
    since: float = 0.0  # [s] since the begin
    memory: Any = None  # what the fault keeps from tick to tick

    def done(self, over: float) -> float:
        """Return the part 0..1 of a transition of `over` [s] that is done."""
        return 1.0 if self.since >= over else self.since / over


class PlantFault(Fault):
    """A fault of sensors, actuators, payload or wind. PHYSICS: it needs `Plant.disturb`.

    Samples, commands and disturbance are made anew at each tick. Faults therefore add up, and the
    end of a fault needs no code.
    """

    PLACE: ClassVar[str] = PLANT
    PHYSICS: ClassVar[bool] = False

    def sense(self, samples: Samples, now: Occurrence) -> None:
        """Change the samples of this tick. Replace the arrays, do not write into them."""

    def act(self, commands: PlantCommands, physics: Disturbance, now: Occurrence) -> None:
        """Change commands and physics of the next period."""
