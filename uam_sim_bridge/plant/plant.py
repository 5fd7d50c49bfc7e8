"""The interface between the simulator and a physics engine.

A physics engine is one class, a `Plant`. It is selected by a name of PLANTS or as
"module:Class": `uam fly --plant`, parameter `plant` of the node mujoco_sim. At each control tick
the simulator calls

    samples = plant.sense()                    samples of the sensors
    truth = plant.truth()                      for the recording and the autopilot's simulator link
    samples = plant.observe(row)               both in one call, in the direct engine
    plant.disturb(disturbance)                 only in a flight with faults of the physics
    plant.step(motors, arm, magnet)            physics of one control period
"""

from __future__ import annotations

import inspect
import math
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uam_control.coordinates import ALPHA
from uam_control.vehicle import VehicleDescription
from uam_sim_bridge.plant.vehicle import Vehicle

# physics engines by name; a new one is a class and a line here, or "module:Class"
PLANTS = {"mujoco": "uam_sim_bridge.plant.mujoco_plant:MujocoPlant"}
DEFAULT_PLANT = "mujoco"
BROKEN = "the simulation cannot go on"


class PlantError(ValueError):
    """The plant does not exist; the text is one line."""


class PhysicsError(RuntimeError):
    """The physics engine cannot go on; the plant must not be used again."""

    def __init__(self, why: str) -> None:
        super().__init__(f"{BROKEN}: {why}")


@dataclass(slots=True)
class Samples:
    """Sensor samples that arrive at one tick; each is None or a tuple with its stamp [s] first.

    The arrays are contiguous, of float64. A pose is (stamp, position (3,) [m, ENU], quaternion (4,)
    [w x y z], FLU → ENU). The payload's is that of its grip point, the middle of its upper side.
    imu: of the companion computer.
    """

    imu: tuple | None  # (stamp, gyro (3,) [rad/s], specific force (3,) [m/s^2]), FLU
    joints: tuple | None  # (stamp, alpha (n,) [rad], alpha_dot (n,) [rad/s], torque (n,) [N m])
    mocap: tuple | None  # pose of the vehicle
    hil: tuple  # as imu, without delay, for the autopilot's own sensors
    imu_copies: int = 1  # messages with this IMU sample
    payload: tuple | None = None  # pose of the payload
    grip: tuple | None = None  # (stamp, (2,)) opening [m], force [N] of a two-finger gripper
    earlier: Sequence[tuple] = ()  # poses that arrive with mocap, in order, exposed before it

    @property
    def poses(self) -> Sequence[tuple]:
        """All poses of the vehicle, in order."""
        return () if self.mocap is None else (*self.earlier, self.mocap)

    @poses.setter
    def poses(self, poses: Sequence[tuple]) -> None:
        *self.earlier, self.mocap = poses or (None,)


def check_arrays(arrays: Sequence[np.ndarray]) -> None:
    """Raise TypeError unless these are contiguous arrays of float64; compiled code is for those."""
    for array in arrays:
        good = isinstance(array, np.ndarray) and array.dtype == np.float64
        if not (good and array.flags.c_contiguous):
            raise TypeError(
                f"a plant's sample: a contiguous array of float64 expected, not {array!r}"
            )


@dataclass
class Truth:
    """True values, hidden from the controllers; SI, ENU."""

    state: np.ndarray  # (3, 6 + n) as in uam_control.coordinates
    quaternion: np.ndarray  # (4,) [w x y z] FLU → ENU
    payload_position: np.ndarray  # (3,) [m]
    payload_quaternion: np.ndarray  # (4,) [w x y z] FLU → ENU
    magnet_force: float  # [N]
    magnet_swing: float  # [rad]
    rotor_speed: np.ndarray  # (rotors,) [rad/s]
    rotor_thrust: np.ndarray  # (rotors,) [N]
    grip: Sequence[float] = (math.nan, math.nan)  # opening [m] and force [N] of fingers


class TruthRow(NamedTuple):
    """Where the true values of one tick begin in a flat row (width,) of float64; see `Truth`."""

    state: int  # row by row
    rotor_thrust: int
    payload: int  # position and quaternion
    magnet: int  # force, swing
    grip: int
    width: int

    @classmethod
    def of(cls, vehicle: VehicleDescription) -> TruthRow:
        """Return the places for a vehicle."""
        thrust = 3 * (ALPHA + len(vehicle.joints))
        payload = thrust + len(vehicle.rotors)
        return cls(0, thrust, payload, payload + 7, payload + 9, payload + 11)

    def write(self, truth: Truth, row: np.ndarray) -> None:
        """Write the values of `truth` to row (width,)."""
        row[self.state : self.rotor_thrust] = truth.state.ravel()
        row[self.rotor_thrust : self.payload] = truth.rotor_thrust
        row[self.payload : self.payload + 3] = truth.payload_position
        row[self.payload + 3 : self.magnet] = truth.payload_quaternion
        row[self.magnet : self.grip] = truth.magnet_force, truth.magnet_swing
        row[self.grip : self.width] = truth.grip


@dataclass
class Disturbance:
    """Changes of the physics by faults during one period; see `none`.

    A payload with a swing hangs from one point of the magnet while the magnet is on.
    """

    rotor_parts: np.ndarray  # (rotors,) factor on the thrust of each rotor
    joint_friction: np.ndarray  # (n,) [N m] dry friction added to each joint
    wind: np.ndarray  # (3,) [m/s, ENU] added
    magnet_part: float = 1.0  # factor on the holding force
    payload_swing: float | None = None  # [rad/s] initial pitch rate; None: it lies flat

    @classmethod
    def none(cls, rotors: int, joints: int) -> Disturbance:
        """Return the disturbance that changes nothing."""
        return cls(np.ones(rotors), np.zeros(joints), np.zeros(3))


class Plant(ABC):
    """Vehicle, payload and surroundings. A class is made with the arguments of `MujocoPlant`.

    `senses`, `acts`: whether this plant changes samples, and commands or physics, of the one in
    `physics`.
    """

    DISTURBABLE = True  # implements `disturb`; else only faults of the physics are refused
    HAS_EFFECTS = False  # of a preset: `vehicle.numbers["effects"]`; else presets are refused
    senses = acts = False

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle  # as flown
        self.period: float = vehicle.description.control_period  # [s]
        self.joints = len(vehicle.description.joints)
        self.tick = 0  # periods stepped, after those of an earlier simulation
        self.truth_row = TruthRow.of(vehicle.description)  # places in the row of `observe`

    @property
    def physics(self) -> Plant:
        """The plant that samples and steps the physics: this one, or the one that it changes."""
        return self

    def unchanged_for(self) -> float:
        """Return for how many ticks `senses` and `acts` stay as they are; inf: to the end."""
        return math.inf

    @property
    def time(self) -> float:
        """Simulation time [s]."""
        return self.tick * self.period

    @abstractmethod
    def sense(self) -> Samples:
        """Sample the sensors and return the samples that arrive now; call it once per tick."""

    @abstractmethod
    def step(self, motor_commands: np.ndarray, arm_command: np.ndarray, magnet: bool) -> None:
        """Advance one control period, and `tick` by 1.

        motor_commands (rotors,): 0..1 in PX4's order; arm_command (n,): effort [N m], or goal
        positions [rad] of servos in position control, sent now, delayed by the bus; both contiguous
        arrays of float64; magnet: current on. Raises PhysicsError.
        """

    @abstractmethod
    def truth(self) -> Truth:
        """Return a copy of the true values at this tick."""

    def observe(self, row: np.ndarray) -> Samples:
        """Return the samples of `sense`; write the true values to row (truth_row.width,).

        The direct engine calls it instead of `sense` and `truth`. A class may do both at once.
        """
        samples = self.sense()
        self.truth_row.write(self.truth(), row)
        return samples

    def disturb(self, disturbance: Disturbance) -> None:
        """Apply `disturbance` until the next call."""
        raise NotImplementedError

    def open_to(self, opening: float) -> None:
        """Let fingers, when they open, open to `opening` [m]."""
        raise NotImplementedError

    def push(self, force: np.ndarray, torque: np.ndarray) -> None:
        """Push the base until the next call: force (3,) [N, ENU], torque (3,) [N m, FLU].

        For the hands of a rehearsal, at the base's origin.
        """
        raise NotImplementedError


def warm_up(spare: Plant) -> None:
    """Compile the functions of a tick with a spare plant: a first call takes long."""
    rotors = len(spare.vehicle.description.rotors)
    for _ in range(10):
        spare.sense()
        spare.truth()
        spare.step(np.zeros(rotors), np.zeros(spare.joints), False)


def plant_class(name: str) -> type[Plant]:
    """Return the class of a name in PLANTS or of "module:Class"; raises PlantError."""
    place = PLANTS.get(name, name)
    if ":" not in place:
        raise PlantError(
            f"unknown plant '{name}'; there are: {', '.join(PLANTS)}, or a class as module:Class"
        )
    try:
        found = pkgutil.resolve_name(place)
    except (ImportError, AttributeError, ValueError) as error:
        raise PlantError(f"plant '{name}': {error}") from None
    if not (inspect.isclass(found) and issubclass(found, Plant)) or inspect.isabstract(found):
        raise PlantError(f"plant '{name}': a class that is a Plant with all its methods expected")
    return found
