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

AXES = ("ROLL", "PITCH", "YAW")  # of PX4's rate loop, MC_*RATE_P
GRAVITY = 9.81  # [m/s^2] of parameter sets that no vehicle's description fills


@dataclass(frozen=True)
class Rotor:
    """One rotor, in PX4's motor order.

    position: x, y, z in the base frame (FLU) [m]; counter_clockwise: seen from above.
    """

    name: str
    position: tuple[float, float, float]
    counter_clockwise: bool


@dataclass(frozen=True)
class RotorModel:
    """Parameters common to all rotors.

    thrust_coefficient [N s^2/rad^2]; speed_max [rad/s]; curve_factor f [1] in
    T/Tmax = f u^2 + (1 - f) u for motor command u (PX4: THR_MDL_FAC); moment_ratio: reaction torque
    per thrust [m]; lag_up, lag_down: time constants of the speed [s]; radius of the propeller [m].
    """

    thrust_coefficient: float
    speed_max: float
    curve_factor: float
    moment_ratio: float
    lag_up: float
    lag_down: float
    radius: float

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
    """Parameters of the servo of a joint.

    stall_torque [N m]; no_load_speed [rad/s]; effort_limit: measured torque at which the supervisor
    holds [N m].
    """

    stall_torque: float
    no_load_speed: float
    effort_limit: float


@dataclass(frozen=True)
class Joint:
    """One joint of the arm; name as in the MJCF and in /joint_states.

    low, high: position limits [rad]; stowed: angle for take-off and landing [rad].
    """

    name: str
    low: float
    high: float
    stowed: float


def servo_of(numbers: dict[str, Any], joint: int) -> dict[str, Any]:
    """Return the entries of `servos` in a description's numbers for a joint, counted from 0."""
    entries = numbers["servos"].items()
    return {key: one[joint] if isinstance(one, list) else one for key, one in entries}


@dataclass(frozen=True)
class VehicleDescription:
    """The content of the file config/vehicle/NAME.yaml.

    file: that file; model: its MJCF file. mass: with arm, without payload [kg]; gravity [m/s^2];
    control_period [s]. profiles: parameter files by control law, see `profile`; autopilot:
    the file of config/autopilot with the autopilot's gains, "" if the file names none;
    autopilot_gains: its content or the design's, by PX4's names, {} without either. end_effector:
    site of the MJCF, "" if the file names none, see `chain_reader`. servos: of each joint. numbers:
    the whole file, including the values that only the plant reads; an entry of `servos` that is not
    the same for all joints is a list.
    """

    name: str
    file: Path
    model: Path
    mass: float
    gravity: float
    control_period: float
    rotor: RotorModel
    rotors: tuple[Rotor, ...]
    servos: tuple[Servo, ...]
    joints: tuple[Joint, ...]
    end_effector: str
    profiles: dict[str, str]
    autopilot: str
    autopilot_gains: dict[str, float]
    numbers: dict[str, Any]

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
            }
        return values
