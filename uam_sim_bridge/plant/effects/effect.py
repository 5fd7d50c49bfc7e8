"""Base classes of effects: a parameter set, and the object that acts in a flight.

An effect is a subclass of `Effect`. Its fields are its parameters, its docstring is the description
for the user, and its name is that of the class: `GroundEffect` is `ground_effect`. The numbers are
in config/plant/; a parameter has no default.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, dataclass_transform

import mujoco
import numpy as np

from uam_control.maths.memory import Number, record
from uam_control.settings.parameter_set import ANY_LENGTH, Bound, NamedSet, number, vector
from uam_sim_bridge.plant.actuators import Rotors
from uam_sim_bridge.plant.physics import Body
from uam_sim_bridge.plant.plant import PlantError
from uam_sim_bridge.plant.sensors import VEHICLE_POSE, Mocap, Noise
from uam_sim_bridge.plant.vehicle import BASE, Vehicle

Pose = tuple[float, np.ndarray, np.ndarray]  # stamp [s], position [m, ENU], quaternion [w x y z]

AIR = 1.2  # [kg/m^3] density


def size(description: str, unit: str, low: float, high: float) -> Any:
    """Declare a parameter of an effect, within [low, high]; its value comes from config/plant."""
    return number(math.nan, description, unit, low, high)


def each(description: str, unit: str, low: float, high: float, optional: bool = False) -> Any:
    """Declare a parameter with a number for each rotor or joint, or one for all of them.

    optional: the list may be empty.
    """
    return vector((), description, unit, low, high, ANY_LENGTH, optional)


def several(description: str, unit: str, low: float, high: float, length: int = 3) -> Any:
    """Declare a parameter of `length` numbers."""
    return vector((), description, unit, low, high, length)


@dataclass
class Bench:
    """The parts of a plant on which effects act. Its arrays never move.

    `period` [s]: of control; `joints`: number n; `arm`: their degrees of freedom; `base_position`
    (3,), `base_axes` (9,): of MuJoCo.
    """

    vehicle: Vehicle
    model: mujoco.MjModel
    data: mujoco.MjData
    rotors: Rotors  # their efficiency and constants may change
    mocap: Mocap
    body: Body  # the vehicle's arrays

    lost, late = Number(), Number()  # whether the newest pose is; [s] its added delay

    def __post_init__(self) -> None:
        self.memory = record("lost", "late")
        described, model = self.vehicle.description, self.model
        self.period, self.joints = described.control_period, len(described.joints)
        first = model.joint(described.joint_names[0]).dofadr[0]
        self.arm = slice(first, first + self.joints)
        self.sample = np.empty(8 + 3 * self.joints)  # newest of IMU and joints, see `PlantArrays`
        self.pose = self.mocap.arrays.taken[VEHICLE_POSE]  # newest of the motion capture
        self.lift = np.ones(len(described.rotors))  # factors on the thrust; 1 before each tick
        self.positions = np.array([rotor.position for rotor in described.rotors])  # [m, FLU]
        turns = [1.0 if r.counter_clockwise else -1.0 for r in described.rotors]
        self.directions = np.array(turns)
        base = model.body(BASE).id
        self.base_position, self.base_axes = self.data.xpos[base], self.data.xmat[base]

    def for_each(self, name: str, values: Sequence[float], count: int, of: str) -> np.ndarray:
        """Return values (count,) of a parameter declared by `each`; raise PlantError."""
        if len(values) not in (1, count):
            raise PlantError(
                f"effect {name}: {len(values)} numbers; allowed: one, or one for each of the "
                f"{count} {of} of {self.vehicle.description.name}"
            )
        return np.resize(np.array(values), count)


class Acting:
    """An effect in a flight; a subclass in Python implements some of the methods. `steps`: see
    `Compiled`; noises: of which a tick or a pose uses at most one row each."""

    steps: Mapping[str, Callable[[tuple], int]] = {}
    noises: Sequence[Noise] = ()

    def tick(self) -> None:
        """Set the loads of the next control period."""

    def joints(self) -> None:
        """Change the torques of the joints for the next physics step."""

    def imu(self, gyro: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return gyro (3,) [rad/s] and specific force (3,) [m/s^2], FLU, with the effect."""
        return gyro, force

    def pose(self, pose: Pose) -> Pose | None:
        """Return the mocap pose as the effect changes it; None for a lost pose."""
        return pose

    def lateness(self) -> float:
        """Return the delay [s] that the effect adds to the pose of this tick."""
        return 0.0


class Compiled(Acting):
    """An effect whose steps are compiled functions of one tuple, by the names of HOOKS."""

    def __init__(
        self, arrays: tuple, noises: Sequence[Noise] = (), **steps: Callable[[tuple], int]
    ) -> None:
        """steps: return 0."""
        self.arrays, self.noises, self.steps = arrays, noises, steps


# tick: before the physics of a control period; joints: at each physics step, changes
# `Bench.torque_control`; sample, pose: change `Bench.sample`, `Bench.pose` when they are taken
HOOKS = ("tick", "joints", "sample", "pose")


@dataclass_transform(frozen_default=True, field_specifiers=(size, each, several))
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
        """Return name and range of each number."""
        return [(name, spec) for name, spec in cls.specs().items() if isinstance(spec, Bound)]
