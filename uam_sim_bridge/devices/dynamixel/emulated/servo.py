"""One emulated servo of the X series: control table, access rights, errors, watchdog.

Source of the behaviour: ROBOTIS e-manual, XM430-W210 and Protocol 2.0.
"""

import math
import time
from collections.abc import Callable

from uam_sim_bridge.devices.dynamixel import control_table as names
from uam_sim_bridge.devices.dynamixel import protocol
from uam_sim_bridge.devices.dynamixel.control_table import (
    FIRST_RAM,
    WATCHDOG_TRIPPED,
    WATCHDOG_UNIT,
    Register,
    control_table,
)
from uam_sim_bridge.devices.dynamixel.emulated.shafts import Drive, Shaft
from uam_sim_bridge.devices.dynamixel.health import ERRORS
from uam_sim_bridge.devices.dynamixel.protocol import word

READ_ONLY = (
    *(names.MODEL_NUMBER, "Model Information", names.FIRMWARE, names.HARDWARE_ERROR),
    *("Registered Instruction", "Realtime Tick", "Moving", "Moving Status", "Present PWM"),
    *(names.PRESENT_CURRENT, names.PRESENT_VELOCITY, names.PRESENT_POSITION),
    *("Velocity Trajectory", "Position Trajectory"),
    *(names.PRESENT_VOLTAGE, names.PRESENT_TEMPERATURE),
)
# as delivered; entries that the model lacks are left out
DEFAULTS = {
    **{names.ID: 1, names.BAUD_RATE: 1, names.RETURN_DELAY: 250, names.OPERATING_MODE: 3},
    **{"Secondary(Shadow) ID": 255, "Protocol Type": 2, "Moving Threshold": 10},
    **{"Temperature Limit": 80, "Max Voltage Limit": 160, "Min Voltage Limit": 95},
    **{"PWM Limit": 885, names.CURRENT_LIMIT: 1193, "Velocity Limit": 350},
    **{"Max Position Limit": 4095, "Min Position Limit": 0, names.SHUTDOWN: 52},
    **{names.STATUS_LEVEL: 2, "Velocity I Gain": 1920, "Velocity P Gain": 100},
    **{names.POSITION_P_GAIN: 800, "Goal PWM": 885},
}
GOALS = ("Goal PWM", names.GOAL_CURRENT, "Goal Velocity", names.GOAL_POSITION)
# register → register with its largest absolute value
LIMITED = {names.GOAL_CURRENT: names.CURRENT_LIMIT, "Goal PWM": "PWM Limit"}
RANGES = {
    names.TORQUE_ENABLE: (0, 1),
    names.BAUD_RATE: (0, len(names.BAUD_RATES) - 1),
    names.ID: (0, protocol.LAST_ID),
    names.RETURN_DELAY: (0, 254),
    names.BUS_WATCHDOG: (0, 127),
    names.STATUS_LEVEL: (0, 2),
    names.CURRENT_LIMIT: (0, 1193),
}


class EmulatedServo:
    """A servo with its memory; `connected`: False while its cable or its supply is off."""

    def __init__(
        self,
        servo: int,
        shaft: Shaft,
        model: str = "xm430_w210",
        baud_rate: int = 57600,
        firmware: int = 50,
        current_unit: float = 0.00269,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """servo: its id; current_unit [A]; clock [s]: of the watchdog."""
        self.table, self.shaft, self.connected = control_table(model), shaft, True
        self.temperature, self.voltage = 35.0, 12.0  # [deg C], [V] of the sensors
        self._unit, self._clock = current_unit, clock
        self._memory = bytearray(max(one.end for one in self.table.registers.values()))
        self._heard = clock()
        self._shut_down = False
        for name, value in DEFAULTS.items():
            if name in self.table.registers:
                self.set(name, value)
        self.set(names.MODEL_NUMBER, self.table.number)
        self.set(names.FIRMWARE, firmware)
        self.set(names.ID, servo)
        self.set(names.BAUD_RATE, names.BAUD_RATES.index(baud_rate))
        self._volatile = bytes(self._memory[FIRST_RAM:])

    @property
    def id(self) -> int:
        return self.get(names.ID)

    @property
    def baud_rate(self) -> int:
        """Its baud rate [1/s]."""
        return names.BAUD_RATES[self.get(names.BAUD_RATE)]

    @property
    def return_delay(self) -> float:
        """Time [s] between an instruction and its status packet."""
        return self.get(names.RETURN_DELAY) * names.RETURN_DELAY_UNIT

    @property
    def alert(self) -> int:
        """The error bit of every status packet while a hardware error is set."""
        return protocol.ALERT if self.get(names.HARDWARE_ERROR) else 0

    def get(self, name: str, signed: bool = False) -> int:
        return int.from_bytes(self.table[name].of(self._memory, 0), "little", signed=signed)

    def set(self, name: str, value: int) -> None:
        """Set a register to a signed value, without regard to access rights."""
        at = self.table[name]
        self._memory[at.address : at.end] = word(value, at.size)

    def raise_error(self, error: str) -> None:
        """Set a hardware error, of ERRORS; the shutdown register decides on the torque."""
        bit = 1 << ERRORS[error][0]
        self.set(names.HARDWARE_ERROR, self.get(names.HARDWARE_ERROR) | bit)
        if bit & self.get(names.SHUTDOWN):
            self._shut_down = True
            self.set(names.TORQUE_ENABLE, 0)
            self._drive()

    def restart(self) -> None:
        """Reboot, or power lost and back: EEPROM stays, errors and torque are off."""
        self._memory[FIRST_RAM:] = self._volatile
        self._shut_down = False
        self._drive()

    def tick(self, heard: bool) -> None:
        """Advance the watchdog; heard: an instruction is on the bus now."""
        now, limit = self._clock(), self.get(names.BUS_WATCHDOG)
        if 0 < limit < WATCHDOG_TRIPPED and self.get(names.TORQUE_ENABLE):
            if now - self._heard > limit * WATCHDOG_UNIT:
                self.set(names.BUS_WATCHDOG, WATCHDOG_TRIPPED)
                self.set(names.GOAL_CURRENT, 0)
                self._drive()
        if heard:
            self._heard = now

    def read(self, address: int, length: int) -> tuple[int, bytes]:
        """Return (error, data) of a Read."""
        if length == 0 or address + length > len(self._memory):
            return protocol.ACCESS | self.alert, b""
        self._sense()
        return self.alert, bytes(self._memory[address : address + length])

    def write(self, address: int, data: bytes) -> int:
        """Write, and return the error of the status packet; a refused write changes nothing."""
        if not data or address + len(data) > len(self._memory):
            return protocol.ACCESS | self.alert
        touched = self._touched(address, len(data))
        if error := self._refusal(address, data, touched):
            return error | self.alert
        before = self.get(names.OPERATING_MODE)
        torque_before = self.get(names.TORQUE_ENABLE)
        self._memory[address : address + len(data)] = data
        if self.get(names.OPERATING_MODE) != before:
            self.set(names.GOAL_CURRENT, 0)
        if self.get(names.TORQUE_ENABLE) > torque_before:
            self._sense()
            self.set(names.GOAL_POSITION, self.get(names.PRESENT_POSITION))
            limit = self.get(names.CURRENT_LIMIT)
            self.set(names.GOAL_CURRENT, 0 if self.get(names.OPERATING_MODE) == 0 else limit)
        if any(name in (*GOALS, names.TORQUE_ENABLE, names.BUS_WATCHDOG) for name in touched):
            self._drive()
        return self.alert

    def _touched(self, address: int, length: int) -> dict[str, Register]:
        """Return the registers that a write overlaps."""
        return {
            name: at
            for name, at in self.table.registers.items()
            if at.address < address + length and address < at.end and "Indirect" not in name
        }

    def _refusal(self, address: int, data: bytes, touched: dict[str, Register]) -> int:
        """Return the error of a write, 0 if it is allowed."""
        if any(name in READ_ONLY for name in touched):
            return protocol.ACCESS
        if self.get(names.TORQUE_ENABLE) and address < FIRST_RAM:
            return protocol.ACCESS
        tripped = self.get(names.BUS_WATCHDOG) == WATCHDOG_TRIPPED
        for name, at in touched.items():
            if at.address < address or at.end > address + len(data):
                return protocol.DATA_LENGTH
            value = int.from_bytes(at.of(data, address), "little")
            if tripped and name in GOALS:
                return protocol.DATA_RANGE
            if name == names.TORQUE_ENABLE and value and self._shut_down:
                return protocol.RESULT_FAIL
            low, high = RANGES.get(name, (0, math.inf))
            if not low <= value <= high or (
                name == names.OPERATING_MODE and value not in names.MODE_NAMES
            ):
                return protocol.DATA_RANGE
            size = abs(int.from_bytes(at.of(data, address), "little", signed=True))
            if name in LIMITED and size > self.get(LIMITED[name]):
                return protocol.DATA_LIMIT
        return 0

    def _sense(self) -> None:
        """Fill the registers of the sensors; too much heat is an error."""
        angle, velocity, current = self.shaft.sense()
        counts = round(angle * self.table.counts_per_turn / (2.0 * math.pi))
        self.set(names.PRESENT_POSITION, counts + self.table.counts_per_turn // 2)
        self.set(names.PRESENT_VELOCITY, round(velocity / self.table.velocity_unit))
        self.set(names.PRESENT_CURRENT, max(-32768, min(32767, round(current / self._unit))))
        self.set(names.PRESENT_TEMPERATURE, round(self.temperature))
        self.set(names.PRESENT_VOLTAGE, round(self.voltage / names.VOLTAGE_UNIT))
        if self.temperature > self.get("Temperature Limit"):
            self.raise_error("overheating")
        low, high = self.get("Min Voltage Limit"), self.get("Max Voltage Limit")
        if not low <= round(self.voltage / names.VOLTAGE_UNIT) <= high:
            self.raise_error("input voltage")

    def _drive(self) -> None:
        """Hand the goals to the motor."""
        counts = self.get(names.GOAL_POSITION, signed=True) - self.table.counts_per_turn // 2
        self.shaft.drive(
            Drive(
                on=bool(self.get(names.TORQUE_ENABLE)),
                mode=self.get(names.OPERATING_MODE),
                current=self.get(names.GOAL_CURRENT, signed=True) * self._unit,
                position=counts * 2.0 * math.pi / self.table.counts_per_turn,
            )
        )
