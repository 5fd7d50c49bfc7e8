"""Control tables of Dynamixel servos, read from the maker's .model files.

The files are part of the package dynamixel-sdk (dynamixel_easy_sdk/control_table). They have
addresses, sizes, the unit of the velocity and the counts of a turn, but no access rights, no
initial values and no unit of the current.
"""

import importlib.util
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from uam_sim_bridge.devices import INSTALL

FIRST_RAM = 64  # addresses below are EEPROM: written with torque off only
BAUD_RATES = (9600, 57600, 115200, 1000000, 2000000, 3000000, 4000000, 4500000)  # by register value

# Names of the maker's files
MODEL_NUMBER, FIRMWARE, ID, BAUD_RATE = "Model Number", "Firmware Version", "ID", "Baud Rate"
RETURN_DELAY, DRIVE_MODE, OPERATING_MODE = "Return Delay Time", "Drive Mode", "Operating Mode"
CURRENT_LIMIT, SHUTDOWN = "Current Limit", "Shutdown"
TORQUE_ENABLE, HARDWARE_ERROR = "Torque Enable", "Hardware Error Status"
STATUS_LEVEL, POSITION_P_GAIN, PWM_LIMIT = "Status Return Level", "Position P Gain", "PWM Limit"
BUS_WATCHDOG, GOAL_CURRENT, GOAL_POSITION = "Bus Watchdog", "Goal Current", "Goal Position"
PRESENT_CURRENT, PRESENT_VELOCITY = "Present Current", "Present Velocity"
PRESENT_POSITION, PRESENT_VOLTAGE = "Present Position", "Present Input Voltage"
PRESENT_TEMPERATURE, PROFILE_VELOCITY = "Present Temperature", "Profile Velocity"

# Operating Mode, ROBOTIS e-manual
CURRENT_MODE, POSITION_MODE, CURRENT_POSITION_MODE = 0, 3, 5
MODE_NAMES = {
    0: "current",
    1: "velocity",
    3: "position",
    4: "extended position",
    5: "current-based position",
    16: "PWM",
}
RETURN_DELAY_UNIT = 2e-6  # [s]
WATCHDOG_UNIT = 0.020  # [s]
WATCHDOG_TRIPPED = 255  # -1: goals are read-only until 0 is written
VOLTAGE_UNIT = 0.1  # [V]


class ControlTableError(ValueError):
    """A model without control table; the text is one line."""


@dataclass(frozen=True)
class Register:
    """One entry of a servo's table: address and size in bytes."""

    address: int
    size: int

    @property
    def end(self) -> int:
        """First address behind the entry."""
        return self.address + self.size

    def of(self, data: bytes, start: int) -> bytes:
        """Return its bytes in `data`, which begin at the address `start`."""
        return data[self.address - start : self.end - start]


@dataclass(frozen=True)
class ControlTable:
    """Registers of a model by name, and the units of position and velocity."""

    model: str
    number: int
    registers: dict[str, Register]
    counts_per_turn: int  # of the position
    velocity_unit: float  # [rad/s]

    def __getitem__(self, name: str) -> Register:
        """Return the register of that name. Raises ControlTableError."""
        if name not in self.registers:
            raise ControlTableError(f"{self.model} has no register '{name}'")
        return self.registers[name]

    def span(self, *names: str) -> Register:
        """Return the smallest register that contains those of all `names`."""
        found = [self[name] for name in names]
        first = min(one.address for one in found)
        return Register(first, max(one.end for one in found) - first)


def folder() -> Path:
    """Return the maker's folder of .model files. Raises ControlTableError without the package."""
    found = importlib.util.find_spec("dynamixel_easy_sdk")
    if found is None or found.origin is None:
        raise ControlTableError(f"the package dynamixel-sdk is missing: {INSTALL}")
    return Path(found.origin).parent / "control_table"


@cache
def model_numbers() -> dict[str, int]:
    """Return model → model number, for example xm430_w210 → 1030."""
    numbers = {}
    for line in (folder() / "dynamixel.model").read_text(encoding="utf-8").splitlines()[1:]:
        number, _, file = line.strip().partition("\t")
        if file:
            numbers[file.removesuffix(".model")] = int(number)
    return numbers


def model_name(number: int) -> str:
    """Return the model of a model number, or the number as text if no file has it."""
    return {value: name for name, value in model_numbers().items()}.get(number, str(number))


@cache
def control_table(model: str) -> ControlTable:
    """Return the control table of `model`, as xm430_w210. Raises ControlTableError."""
    numbers = model_numbers()
    if model not in numbers:
        known = ", ".join(name for name in numbers if name.startswith("x"))
        raise ControlTableError(f"unknown servo model '{model}'; X series: {known}")
    file = folder() / f"{model}.model"
    if not file.is_file():
        raise ControlTableError(f"the installed dynamixel-sdk has no control table of {model}")
    sections = _sections(file.read_text(encoding="utf-8"))
    registers: dict[str, Register] = {}
    for address, size, name in sections["control table"]:
        registers.setdefault(name, Register(int(address), int(size)))
    types = {row[0]: float(row[1]) for row in sections["type info"]}
    units = {row[0]: float(row[1]) for row in sections["unit info"]}
    span = types["value_of_max_radian_position"] - types["value_of_min_radian_position"]
    radians = types["max_radian"] - types["min_radian"]
    return ControlTable(
        model=model,
        number=numbers[model],
        registers=registers,
        counts_per_turn=round((span + 1) * 2.0 * math.pi / radians),
        velocity_unit=units[PRESENT_VELOCITY],
    )


def _sections(text: str) -> dict[str, list[list[str]]]:
    """Return the rows of each [section] of a .model file, without their heads."""
    sections: dict[str, list[list[str]]] = {}
    for line in map(str.strip, text.splitlines()):
        if line.startswith("["):
            rows = sections[line.strip("[]")] = []
        elif line:
            rows.append(line.split("\t"))
    return {name: rows[1:] for name, rows in sections.items()}
