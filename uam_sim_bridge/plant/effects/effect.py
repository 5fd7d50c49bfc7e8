"""Base classes of effects: a parameter set, and the object that acts in a flight.

An effect is a subclass of `Effect`. Its fields are its parameters, its docstring is the description
for the user, and its name is that of the class: `GroundEffect` is `ground_effect`. The numbers are
in config/plant/; a parameter has no default.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, dataclass_transform

import mujoco
import numpy as np

from uam_control.settings.named_set import NamedSet
from uam_control.settings.parameter_set import Bound, number
from uam_sim_bridge.plant.actuators import Rotors
from uam_sim_bridge.plant.vehicle import Vehicle

Pose = tuple[float, np.ndarray, np.ndarray]  # stamp [s], position [m, ENU], quaternion [w x y z]

AIR = 1.2  # [kg/m^3] density


def size(description: str, unit: str, low: float, high: float) -> Any:
    """Declare a parameter of an effect, within [low, high]; its value comes from config/plant."""
    return number(math.nan, description, unit, low, high)


@dataclass
class Bench:
    """The parts of a plant on which effects act.

    rotors: their efficiency and constants may change; arm: first degree of freedom and number of
    joints; lift (rotors,): factors on the thrust of the next tick, set to 1 before each tick;
    positions (rotors, 3) [m, FLU] and directions (rotors,), 1 for counter-clockwise.
    """

    vehicle: Vehicle
    model: mujoco.MjModel
    data: mujoco.MjData
    rotors: Rotors
    period: float
    arm: tuple[int, int]
    torque_control: np.ndarray
    servo_torque: np.ndarray

    def __post_init__(self) -> None:
        rotors = self.vehicle.description.rotors
        self.lift = np.ones(len(rotors))
        self.positions = np.array([rotor.position for rotor in rotors])
        self.directions = np.array([1.0 if r.counter_clockwise else -1.0 for r in rotors])
        base = self.model.body("base").id
        self.base_position = self.data.xpos[base]
        self.base_axes = self.data.xmat[base]  # row by row, body → world

    @property
    def arm_dofs(self) -> slice:
        """Degrees of freedom of the joints."""
        return slice(self.arm[0], self.arm[0] + self.arm[1])


class Acting:
    """An effect in a flight. A subclass implements some of the methods; see `HOOKS`."""

    def tick(self) -> None:
        """Set the loads of the next control period."""

    def joints(self) -> None:
        """Change the torques of the joints for the next physics step."""

    def imu(self, gyro: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return gyro (3,) [rad/s] and specific force (3,) [m/s^2], FLU, as the effect changes
        them."""
        return gyro, force

    def pose(self, pose: Pose) -> Pose | None:
        """Return the mocap pose as the effect changes it; None for a lost pose."""
        return pose

    def lateness(self) -> float:
        """Return the delay [s] that the effect adds to the pose of this tick."""
        return 0.0


HOOKS = ("tick", "joints", "imu", "pose", "lateness")


@dataclass_transform(frozen_default=True, field_specifiers=(size,))
class Effect(NamedSet):
    """Base of all effects. SOURCE: where model and numbers are from."""

    SOURCE: ClassVar[str] = ""

    def begin(self, bench: Bench, noise: np.random.Generator) -> Acting | None:
        """Return the object that acts in a flight; None if the effect acts only here.

        noise: generator of this effect, from the seed of the flight.
        """
        raise NotImplementedError

    @classmethod
    def ranges(cls) -> Sequence[tuple[str, Bound]]:
        """Return name and range of each parameter."""
        return [(name, spec) for name, spec in cls.specs().items() if isinstance(spec, Bound)]
