"""The chain of servos as described: section `arm` of a lab file and the vehicle's joints."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uam_control.settings import configuration
from uam_control.settings.section import Section, read_section
from uam_control.vehicle import VehicleDescription
from uam_sim_bridge.devices.dynamixel import control_table as names
from uam_sim_bridge.devices.dynamixel.control_table import (
    ControlTable,
    ControlTableError,
    control_table,
)

DEFAULT_HARDWARE = "s500_lab"  # in config/lab
CHAIN = ("device", "baud_rate", "return_delay_us", "servos", "gripper")
GRIPPER = "gripper"  # name of its servo beside those of the joints
SERVO = (
    *("joint", "id", "model", "direction", "zero", "gear", "current_limit", "torque_scale"),
    *("coulomb", "viscous", "range_deg", "torque_per_current", "current_unit"),
)
LAST_ID = 252
# of the SDK's PortHandler and of the register Baud Rate
SPEEDS = (9600, 57600, 115200, 1000000, 2000000, 3000000, 4000000)
UNIT, SMALL_UNIT = 0.00269, 0.001  # [A] of Goal Current and Present Current: e-manual
SMALL = "330"  # XC330 and XL330 have the small unit
CURRENT_REGISTER_MAX = 32767  # a signed register of two bytes


class ArmError(ValueError):
    """The arm cannot be driven as described; the text is one line."""


@dataclass(frozen=True)
class ServoDescription:
    """One servo and its joint."""

    joint: str
    id: int
    table: ControlTable
    direction: int  # 1 or -1
    zero: int  # [counts] position at angle 0
    gear: float  # turns of the servo per turn of the joint
    torque_constant: float  # [N m/A] at the joint
    current_unit: float  # [A]
    current_limit: float  # [A]
    low: float  # [rad]
    high: float  # [rad]
    stowed: float  # [rad]
    coulomb: float = 0.0  # [N m] friction at the joint
    viscous: float = 0.0  # [N m s/rad] friction at the joint
    torque_scale: float = 1.0  # factor that torque_constant contains
    mode: int | None = None  # its own Operating Mode; None: that of the vehicle's servos
    speed: float = 0.0  # [rad/s] of its own profile in a position mode; 0: none

    @property
    def label(self) -> str:
        """Joint and id, for messages."""
        return f"{self.joint} (id {self.id})"

    @property
    def count(self) -> float:
        """Joint angle of one count of the position [rad], with the sign of the direction."""
        return self.direction * 2.0 * math.pi / self.table.counts_per_turn / self.gear

    def angle(self, counts: int) -> float:
        """Return the joint angle [rad] at a position [counts]."""
        return (counts - self.zero) * self.count

    def counts(self, angle: float) -> int:
        """Return the position [counts] at a joint angle [rad]."""
        return self.zero + round(angle / self.count)

    def velocity(self, raw: int) -> float:
        """Return the joint velocity [rad/s] of the register Present Velocity."""
        return raw * self.direction * self.table.velocity_unit / self.gear

    def effort(self, raw: int) -> float:
        """Return the motor's torque at the joint [N m] of a current register."""
        return raw * self.direction * self.current_unit * self.torque_constant

    def current(self, effort: float) -> int:
        """Return the current register of a motor torque at the joint [N m], within the limit."""
        raw = round(self.direction * effort / self.torque_constant / self.current_unit)
        return max(-self.current_limit_counts, min(self.current_limit_counts, raw))

    @property
    def current_limit_counts(self) -> int:
        """Value of the register Current Limit."""
        return int(self.current_limit / self.current_unit + 1e-9)

    def turned(self, counts: int) -> int:
        """Return whole turns [counts] to add to a position so that its angle fits the range best.

        After a start a servo reports its position within one turn.
        """
        turn, middle = self.table.counts_per_turn, 0.5 * (self.low + self.high)
        return turn * round((self.counts(middle) - counts) / turn)


@dataclass(frozen=True)
class ArmChain:
    """Servos on a serial line."""

    device: str
    baud_rate: int
    return_delay: float  # [s] of every servo
    servos: tuple[ServoDescription, ...]  # base to tip; the last one may be a gripper's
    transmission: float = 0.0  # [m/rad] opening / angle of the gripper's servo

    @property
    def arm(self) -> tuple[ServoDescription, ...]:
        """The servos of the joints."""
        return tuple(servo for servo in self.servos if servo.joint != GRIPPER)

    @property
    def gripper(self) -> ServoDescription | None:
        """The servo of the gripper, None without."""
        return next((servo for servo in self.servos if servo.joint == GRIPPER), None)

    @property
    def ids(self) -> tuple[int, ...]:
        """The servos' ids, base to tip."""
        return tuple(servo.id for servo in self.servos)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, base to tip."""
        return tuple(servo.joint for servo in self.arm)

    @property
    def return_delay_counts(self) -> int:
        """Value of the register Return Delay Time."""
        return round(self.return_delay / names.RETURN_DELAY_UNIT)


def hardware_file(name_or_file: str) -> Path:
    """Return the file of config/lab, or the file. Raises ConfigurationError."""
    return configuration.named("lab", name_or_file, suffixes=(".yaml",))


def chain_file(file: Path) -> Path:
    """Return the file with the section `arm` of a lab file: itself, or the one that it names.

    Raises ArmError in one line.
    """
    top = read_section(file, ArmError)
    named = top.entry("arm")
    if not isinstance(named, str):
        return file
    beside = file.parent / Path(named).expanduser()
    try:
        return beside if beside.is_file() else hardware_file(named)
    except configuration.ConfigurationError as error:
        raise top.error("arm", str(error)) from None


def load_chain(file: Path, vehicle: VehicleDescription) -> ArmChain:
    """Return the chain that a lab file describes. Raises ArmError."""
    return describe_chain(read_section(chain_file(file), ArmError), vehicle)


def describe_chain(top: Section, vehicle: VehicleDescription) -> ArmChain:
    """Return the checked chain in the section `arm` of `top`. Raises ArmError."""
    arm = top.section("arm")
    arm.only(CHAIN)
    entries = {entry.text("joint"): entry for entry in arm.entries("servos")}
    joints = vehicle.joint_names
    if sorted(entries) != sorted(joints) or len(arm.entries("servos")) != len(joints):
        found = ", ".join(entry.text("joint") for entry in arm.entries("servos"))
        raise arm.error("servos", f"joints {found}; the vehicle has {', '.join(joints)}")
    speed = arm.number("baud_rate")
    if speed not in SPEEDS:
        raise arm.error("baud_rate", f"{speed:.10g} is not one of {', '.join(map(str, SPEEDS))}")
    delay = arm.whole("return_delay_us", 0, 508)
    if delay % 2:
        raise arm.error("return_delay_us", f"{delay} is odd; the servos' unit is 2 us")
    servos = tuple(_servo(entries[name], i, vehicle) for i, name in enumerate(joints))
    numbers = vehicle.numbers.get(GRIPPER)
    if (numbers is None) is arm.has(GRIPPER):
        text = "missing; the vehicle has one" if numbers else "the vehicle has none on the bus"
        raise arm.error(GRIPPER, text)
    if numbers is not None:
        servos = (*servos, _gripper_servo(arm.section(GRIPPER), numbers))
    ids = [servo.id for servo in servos]
    if len(set(ids)) < len(ids):
        raise arm.error("servos", f"ids {', '.join(map(str, ids))}: each servo needs its own")
    transmission = 0.0 if numbers is None else numbers["transmission"]
    return ArmChain(arm.text("device"), int(speed), 1e-6 * delay, servos, transmission)


def _table(entry: Section) -> ControlTable:
    try:
        table = control_table(entry.text("model"))
        for name in (names.GOAL_CURRENT, names.PRESENT_CURRENT, names.BUS_WATCHDOG):
            table[name]
    except ControlTableError as error:
        raise entry.error("model", str(error)) from None
    return table


def _direction(entry: Section) -> int:
    direction = entry.whole("direction", -1, 1)
    if direction == 0:
        raise entry.error("direction", "0 is not one of 1, -1")
    return direction


def _gripper_servo(entry: Section, numbers: dict[str, Any]) -> ServoDescription:
    """Return the servo of a gripper with the `numbers` of the vehicle: goal positions, limited by
    the current that gives its force."""
    entry.only(("id", "model", "direction", "zero"))
    table, lever = _table(entry), numbers["transmission"]
    closed, opened = (opening / lever for opening in numbers["opening"])
    constant, unit = numbers["torque_per_current"], numbers["current_unit"]
    _check_unit(entry, table, unit)
    return ServoDescription(
        joint=GRIPPER,
        id=entry.whole("id", 0, LAST_ID),
        table=table,
        direction=_direction(entry),
        zero=entry.whole("zero", -table.counts_per_turn, 2 * table.counts_per_turn),
        gear=1.0,
        torque_constant=constant,
        current_unit=unit,
        current_limit=numbers["force"] * lever / constant,
        low=closed,
        high=opened,
        stowed=opened,
        mode=names.CURRENT_POSITION_MODE,
        speed=numbers["speed"] / lever,
    )


def _servo(entry: Section, number: int, vehicle: VehicleDescription) -> ServoDescription:
    joint = vehicle.joints[number]
    entry.only(SERVO)
    table, direction = _table(entry), _direction(entry)
    motor = Section(vehicle.servo_numbers(number) | entry.values, entry.where, ArmError)
    unit, gear = motor.positive("current_unit"), entry.positive("gear")
    _check_unit(entry, table, unit)
    limit, scale = entry.positive("current_limit"), entry.positive("torque_scale")
    if limit > unit * CURRENT_REGISTER_MAX:
        raise entry.error("current_limit", f"{limit:g} A is beyond the register")
    low, high = joint.low, joint.high
    if "range_deg" in entry.values:
        own = [math.radians(value) for value in entry.numbers("range_deg", 2)]
        if not low <= own[0] < own[1] <= high:
            inside = f"{math.degrees(low):g} to {math.degrees(high):g}"
            raise entry.error("range_deg", f"not an interval within the vehicle's {inside}")
        low, high = own
    turns = gear * (high - low) / (2.0 * math.pi)
    if turns >= 1.0:  # after a start a servo reports its position within one turn
        raise entry.error(
            "gear",
            f"{gear:g} makes the joint's {math.degrees(high - low):g} deg {turns:.3g} turns of the "
            f"servo; less than one is possible: below {gear / turns:.3g}, or a narrower range_deg",
        )
    return ServoDescription(
        joint=joint.name,
        id=entry.whole("id", 0, LAST_ID),
        table=table,
        direction=direction,
        zero=entry.whole("zero", -table.counts_per_turn, 2 * table.counts_per_turn),
        gear=gear,
        torque_constant=motor.positive("torque_per_current") * scale * gear,
        current_unit=unit,
        current_limit=limit,
        low=low,
        high=high,
        stowed=joint.stowed,
        coulomb=entry.not_negative("coulomb"),
        viscous=entry.not_negative("viscous"),
        torque_scale=scale,
    )


def _check_unit(entry: Section, table: ControlTable, unit: float) -> None:
    """Refuse the current unit [A] of another series: every torque would be wrong by its ratio."""
    own = SMALL_UNIT if SMALL in table.model else UNIT
    if not 0.9 < unit / own < 1.1:
        raise entry.error(
            "model",
            f"{table.model} counts {1e3 * own:g} mA, current_unit is {1e3 * unit:g} mA: give "
            "current_unit [A] and torque_per_current [N m/A] of this servo",
        )
