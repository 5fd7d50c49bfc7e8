"""What the simulator needs of a plant: the interface to a physics engine.

A physics engine is one class, a `Plant`. It is chosen by a name of `engines.PLANTS` or as
"module:Class": `uam fly --plant`, parameter `plant` of the node mujoco_sim. At each control tick
the simulator calls

    samples = plant.sense()                    what the sensors deliver
    truth = plant.truth()                      for the record, and the autopilot's simulator link
    plant.disturb(disturbance)                 only in a flight with faults of the physics
    plant.step(motors, effort, magnet)         physics of one control period
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from uam_sim_bridge.plant.vehicle import Vehicle


@dataclass
class Samples:
    """What arrives at one tick; each entry None or a tuple that begins with its stamp [s].

    imu: (stamp, gyro (3,) [rad/s], specific force (3,) [m/s^2]), FLU, as the companion computer
    gets it. joints: (stamp, alpha (n,), alpha_dot (n,), torque (n,)). mocap: (stamp, position (3,),
    quaternion [w x y z]). hil: as imu, undelayed, for the autopilot's own sensors.
    """

    imu: tuple | None
    joints: tuple | None
    mocap: tuple | None
    hil: tuple


@dataclass
class Truth:
    """What no controller sees. state (3, 6 + n) as in uam_control.coordinates; the rest SI."""

    state: np.ndarray
    quaternion: np.ndarray
    payload_position: np.ndarray
    payload_quaternion: np.ndarray
    magnet_force: float
    magnet_swing: float
    rotor_speed: np.ndarray
    rotor_thrust: np.ndarray


@dataclass
class Disturbance:
    """What faults change in the physics of one period; see `none`.

    rotor_parts (rotors,): part of the thrust of each rotor; joint_friction (n,): dry friction added
    to each joint [N m]; magnet_part: of the holding force; wind (3,): added [m/s, ENU];
    payload_swing: the payload hangs from one point of the magnet while that is on, beginning with
    this pitch rate [rad/s]; None: it lies flat on the magnet.
    """

    rotor_parts: np.ndarray
    joint_friction: np.ndarray
    wind: np.ndarray
    magnet_part: float = 1.0
    payload_swing: float | None = None

    @classmethod
    def none(cls, rotors: int, joints: int) -> Disturbance:
        """Return the disturbance that changes nothing."""
        return cls(np.ones(rotors), np.zeros(joints), np.zeros(3))


class Plant(ABC):
    """Vehicle, payload and surroundings.

    `vehicle`: as flown; `period`: of control [s]; `joints`: their number n; `tick`: number of
    periods stepped. `DISTURBABLE`: whether it has `disturb`; without, faults of the physics are
    refused, those of sensors and commands are not.
    """

    DISTURBABLE = True

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.period: float = vehicle.description.control_period
        self.joints = len(vehicle.description.joints)
        self.tick = 0

    @property
    def time(self) -> float:
        """Simulation time [s]."""
        return self.tick * self.period

    @abstractmethod
    def sense(self) -> Samples:
        """Expose the sensors at this tick and return what arrives now (call once per tick)."""

    @abstractmethod
    def step(self, motor_commands: np.ndarray, arm_effort: np.ndarray, magnet: bool) -> None:
        """Advance one control period, and `tick` by 1.

        motor_commands (rotors,) 0..1 in PX4's order, arm_effort (n,) [N m] as sent now (the bus
        delays it), magnet: current on.
        """

    @abstractmethod
    def truth(self) -> Truth:
        """Return a copy of everything true at this tick."""

    def disturb(self, disturbance: Disturbance) -> None:
        """Let `disturbance` act until the next call."""
        raise NotImplementedError


class PlantFactory(Protocol):
    """How a plant is made; the class of a physics engine is one."""

    def __call__(
        self,
        vehicle: Vehicle,
        payload_mass: float,
        seed: int,
        arm_start: Sequence[float] = (),
        disturbed: bool = False,
    ) -> Plant:
        """payload_mass [kg], 0 for none; seed: of all noise; arm_start (n,): joint angles on the
        ground [rad], empty: stowed as described; disturbed: `disturb` will be called."""
