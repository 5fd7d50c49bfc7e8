"""A vehicle in numbers: rotors, joints, mass, gravity, and the values derived from them.

Frames: FLU body frame (x forward, y left, z up). PX4's parameters are FRD (y right).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uam_control.coordinates import coordinates
from uam_control.settings import configuration
from uam_control.vehicle.gripper import MAGNET, Gripper, gripper_of
from uam_control.vehicle.rotor_geometry import thrust_coefficient

AXES = ("ROLL", "PITCH", "YAW")  # of PX4's rate loop, MC_*RATE_P
GRAVITY = 9.81  # [m/s^2] of parameter sets that no vehicle's description fills


@dataclass(frozen=True)
class Rotor:
    """One rotor, in PX4's motor order."""

    name: str
    position: tuple[float, float, float]  # x, y, z in the base frame (FLU) [m]
    counter_clockwise: bool  # seen from above


@dataclass(frozen=True)
class RotorModel:
    """Parameters common to all rotors."""

    thrust_coefficient: float  # [N s^2/rad^2]
    speed_max: float  # [rad/s]
    curve_factor: float  # f [1]: T/Tmax = f u^2 + (1 - f) u of motor command u (THR_MDL_FAC)
    moment_ratio: float  # reaction torque per thrust [m]
    lag_up: float  # time constant of the speed [s]
    lag_down: float  # [s]
    radius: float  # of the propeller [m]

    @property
    def lag(self) -> float:
        """Time constant [s] of small fast changes of the speed: mean of the rates up and down."""
        return 2.0 / (1.0 / self.lag_up + 1.0 / self.lag_down)

    @property
    def thrust_max(self) -> float:
        """Largest thrust of one rotor [N]."""
        return self.thrust_coefficient * self.speed_max**2


# servos.mode: efforts to the servos' current loop, or goal positions to their position loop
SERVO_MODES = CURRENT_SERVO, POSITION_SERVO = "current", "position"


@dataclass(frozen=True)
class Servo:
    """Parameters of the servo of a joint."""

    stall_torque: float  # [N m]
    no_load_speed: float  # [rad/s]
    effort_limit: float  # measured torque at which the supervisor holds [N m]


@dataclass(frozen=True)
class Joint:
    """One joint of the arm."""

    name: str  # as in the MJCF and in /joint_states
    low: float  # position limit [rad]
    high: float  # [rad]
    stowed: float  # angle for take-off and landing [rad]


def servo_of(numbers: dict[str, Any], joint: int) -> dict[str, Any]:
    """Return the entries of `servos` in a description's numbers for a joint, counted from 0."""
    entries = numbers["servos"].items()
    return {key: one[joint] if isinstance(one, list) else one for key, one in entries}


@dataclass(frozen=True)
class VehicleDescription:
    """The content of the file config/vehicle/NAME.yaml."""

    name: str
    file: Path  # that file
    model: Path  # its MJCF file
    mass: float  # with arm, without payload [kg]
    gravity: float  # [m/s^2]
    control_period: float  # [s]
    rotor: RotorModel
    rotors: tuple[Rotor, ...]
    servos: tuple[Servo, ...]  # of each joint
    joints: tuple[Joint, ...]
    end_effector: str  # site of the MJCF, "" if the file names none, see `chain_reader`
    profiles: dict[str, str]  # parameter files by control law, see `profile`
    autopilot: str  # file of config/autopilot with the autopilot's gains, "" if none is named
    autopilot_gains: dict[str, float]  # its content or the design's, by PX4's names; {} without
    numbers: dict[str, Any]  # the whole file; of servos that differ an entry is a list

    @property
    def source(self) -> str:
        """The argument of `load_description` for this vehicle: name in config/vehicle, or file."""
        own = self.file.parent == configuration.root() / "vehicle"
        return self.name if own else str(self.file.resolve())

    def profile(self, law: str) -> str:
        """Return the profile for a control law; "" if the description names none."""
        return self.profiles.get(law, "")

    @property
    def models(self) -> tuple[Path, ...]:
        """The MJCF files of the vehicle and of its gripper."""
        part = self.numbers.get("gripper")
        return (self.model,) if part is None else (self.model, Path(part["model"]))

    @property
    def gripper(self) -> Gripper:
        """What holds a payload."""
        return gripper_of(self.numbers)

    @property
    def has_magnet(self) -> bool:
        """Whether the arm has a magnet."""
        return self.gripper.kind == MAGNET

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, base to tip."""
        return tuple(joint.name for joint in self.joints)

    @property
    def rotor_names(self) -> tuple[str, ...]:
        """Names of the rotors, in PX4's motor order."""
        return tuple(rotor.name for rotor in self.rotors)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the entries of chi."""
        return coordinates(len(self.joints))

    @property
    def stowed(self) -> tuple[float, ...]:
        """Joint angles for take-off and landing (n,) [rad]."""
        return tuple(joint.stowed for joint in self.joints)

    @property
    def rotor_thrust(self) -> float:
        """Nominal full thrust of one rotor [N]: four digits, as a thrust stand resolves."""
        return float(f"{self.rotor.thrust_max:.4g}")

    @property
    def full_thrust(self) -> float:
        """Nominal full thrust of all rotors [N]."""
        return len(self.rotors) * self.rotor.thrust_max

    @property
    def hover_command(self) -> float:
        """Normalised thrust in hover [1], to 1 %: weight / full thrust, as THR_MDL_FAC
        linearises."""
        return round(self.mass * self.gravity / self.full_thrust, 2)

    def servo_numbers(self, joint: int) -> dict[str, Any]:
        """Return the entries of `servos` for a joint, counted from 0."""
        return servo_of(self.numbers, joint)

    def geometry(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return px, py, km, each (rotors,) [m], in PX4's convention and motor order.

        px forward, py right (FRD); km: moment per thrust, > 0 for counter-clockwise.
        """
        positions = np.array([rotor.position for rotor in self.rotors])
        turns = np.array([1.0 if rotor.counter_clockwise else -1.0 for rotor in self.rotors])
        return positions[:, 0].copy(), -positions[:, 1], turns * self.rotor.moment_ratio

    def autopilot_parameters(self) -> dict[str, float]:
        """Return the autopilot's gains and the values derived from the vehicle, by PX4's names."""
        values: dict[str, float] = self.autopilot_gains | {
            "CA_ROTOR_COUNT": len(self.rotors),
            "THR_MDL_FAC": self.rotor.curve_factor,
            "MPC_THR_HOVER": self.hover_command,
        }
        for i, (px, py, km) in enumerate(zip(*self.geometry(), strict=True)):
            values |= {
                f"CA_ROTOR{i}_PX": float(px),
                f"CA_ROTOR{i}_PY": float(py),
                f"CA_ROTOR{i}_KM": float(km),
                f"CA_ROTOR{i}_CT": thrust_coefficient(self.rotor.moment_ratio),
            }
        return values
