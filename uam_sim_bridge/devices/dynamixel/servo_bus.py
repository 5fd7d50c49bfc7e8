"""Instructions to the servos through the maker's library; results as values, errors in words.

An answer has no number that names its instruction. After a stall of the computer or of the adapter
the answer to an instruction that was given up may come in place of the next one: see `Overdue`.
"""

from __future__ import annotations

import errno
import os
import termios
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress

import serial

from uam_sim_bridge.devices.dynamixel.control_table import Register, signed, unsigned
from uam_sim_bridge.devices.dynamixel.overdue import Instruction, Overdue
from uam_sim_bridge.devices.dynamixel.packet_handler import StuffingPacketHandler
from uam_sim_bridge.devices.dynamixel.port import PatientPort
from uam_sim_bridge.devices.dynamixel.sdk import (
    BROADCAST_ID,
    COMM_RX_CORRUPT,
    COMM_SUCCESS,
    GroupSyncWrite,
)

PING, READ, WRITE, REBOOT = 0x01, 0x02, 0x03, 0x08
ERROR_AT = 8  # place of the error in a status packet; data and CRC follow
EMPTY_STATUS = bytes(11)  # a status packet without data
ALERT = 0x80  # error bit of a status packet: Hardware Error Status is not 0
REFUSALS = {
    1: "the servo could not execute it",
    2: "unknown instruction",
    3: "the instruction arrived damaged",
    4: "value out of range",
    5: "wrong length",
    6: "value beyond its limit register",
    7: "not accessible; EEPROM is locked while torque is on",
}


class BusLost(OSError):
    """The device is gone or cannot be opened; the text is one line."""


class NoAnswer(RuntimeError):
    """A servo did not answer, or its answer was damaged; the text is one line."""

    def __init__(self, text: str, damaged: bool = False) -> None:
        super().__init__(text)
        self.damaged = damaged


class Refused(RuntimeError):
    """A servo refused an instruction; the text is one line."""


class ServoBus:
    """The line with its servos; not for several threads at once.

    `alerts`: ids whose last status packet had the alert bit.
    """

    def __init__(
        self, device: str, baud_rate: int, allowance: float, port: PatientPort | None = None
    ) -> None:
        """allowance [s]: time that an answer has beside the time of its bytes; port: in place of a
        serial device."""
        self.device, self._baud_rate = device, baud_rate
        self._port = port or PatientPort(device, allowance)
        self._sdk = StuffingPacketHandler()
        self._overdue = Overdue()
        self.alerts: set[int] = set()

    def open(self) -> None:
        """Open the device. Raises BusLost."""
        with self._guarded():
            if not self._port.setBaudRate(self._baud_rate):
                raise BusLost(f"{self.device}: no baud rate {self._baud_rate}")

    def set_baud_rate(self, baud_rate: int) -> None:
        """Use another baud rate from now on. Raises BusLost."""
        self._baud_rate = baud_rate
        self.open()

    @contextmanager
    def patient(self, allowance: float) -> Iterator[None]:
        """Give each answer at least `allowance` [s] beside the time of its bytes."""
        usual = self._port.allowance
        self._port.allowance = max(usual, allowance)
        try:
            yield
        finally:
            self._port.allowance = usual

    def close(self) -> None:
        """Close the device."""
        if self._port.is_open:
            try:
                self._port.closePort()
            except (OSError, termios.error):
                self._port.is_open = False

    def ping(self, servo: int) -> int:
        """Return the model number of a servo. Raises NoAnswer, BusLost."""
        data = self._ask(Instruction(servo, PING, b"", 3))  # model number and firmware
        return int.from_bytes(data[:2], "little")

    def scan(self) -> dict[int, tuple[int, int]]:
        """Return id → (model number, firmware) of all servos; takes up to 1.5 s. Raises BusLost."""
        with self._guarded():
            found, _ = self._sdk.broadcastPing(self._port)
        return {servo: (number, firmware) for servo, (number, firmware) in sorted(found.items())}

    def read_bytes(self, servo: int, register: Register) -> bytes:
        """Return the bytes of a register. Raises NoAnswer, Refused, BusLost."""
        place = _bytes(register.address, 2) + _bytes(register.size, 2)
        return self._ask(Instruction(servo, READ, place, register.size))

    def read(self, servo: int, register: Register) -> int:
        """Return the unsigned value of a register. Raises NoAnswer, Refused, BusLost."""
        return int.from_bytes(self.read_bytes(servo, register), "little")

    def read_signed(self, servo: int, register: Register) -> int:
        """Return the signed value of a register. Raises NoAnswer, Refused, BusLost."""
        return signed(self.read(servo, register), register.size)

    def write(self, servo: int, register: Register, value: int) -> None:
        """Write a signed value and wait for the status. Raises NoAnswer, Refused, BusLost."""
        data = _bytes(register.address, 2) + _bytes(value, register.size)
        self._ask(Instruction(servo, WRITE, data, 0))

    def sync_write(self, register: Register, values: Mapping[int, int]) -> None:
        """Write a signed value to each servo, without an answer. Raises BusLost."""
        group = GroupSyncWrite(self._port, self._sdk, register.address, register.size)
        for servo, value in values.items():
            group.addParam(servo, list(_bytes(value, register.size)))
        with self._guarded():
            group.txPacket()

    def sync_read(self, register: Register, servos: Sequence[int], fast: bool) -> dict[int, bytes]:
        """Return id → bytes of the servos that answered. Raises BusLost.

        fast: Fast Sync Read, one packet for all: one silent servo spoils it.
        """
        with self._guarded():
            sent = self._sdk.syncReadTx(
                self._port, register.address, register.size, list(servos), len(servos), fast
            )
            if sent != COMM_SUCCESS:
                return {}
            read = self._fast_answers if fast else self._answers
            return read(register.size, set(servos))

    def reboot(self, servo: int) -> None:
        """Restart a servo. Raises NoAnswer, BusLost."""
        with suppress(Refused):
            self._ask(Instruction(servo, REBOOT, b"", 0))
        self.alerts.discard(servo)

    def _ask(self, instruction: Instruction) -> bytes:
        """Send an instruction to one servo; return the data of its answer.

        Raises NoAnswer, Refused, BusLost.
        """
        with self._guarded():
            self._drop_late()
            result = self._sdk.txPacket(self._port, instruction.packet())
            self._port.setPacketTimeout(instruction.size + len(EMPTY_STATUS))
            while result == COMM_SUCCESS:
                packet, result = self._sdk.rxPacket(self._port, False)
                if result != COMM_SUCCESS:
                    break
                servo, error, data = _parts(packet)
                refused = bool(error & ~ALERT)
                if self._overdue.answers(instruction, servo, data, refused):
                    self._note(servo, error)
                    if refused:
                        code = error & ~ALERT
                        reason = REFUSALS.get(code, f"error {code}")
                        raise Refused(f"id {instruction.servo}: {reason}")
                    return data
        damaged = result == COMM_RX_CORRUPT
        if not damaged or self._overdue:  # the damaged one may be an overdue one
            self._overdue.add(instruction)
        if damaged:
            raise NoAnswer(f"id {instruction.servo}: the answer arrives damaged", damaged=True)
        raise NoAnswer(f"id {instruction.servo}: no answer")

    def _drop_late(self) -> None:
        """Take the answers that have come since the last instruction was given up."""
        while self._overdue:
            self._port.setPacketTimeoutMillis(0.0)
            packet, result = self._sdk.rxPacket(self._port, False)
            if result != COMM_SUCCESS:
                break
            servo, _, data = _parts(packet)
            self._overdue.arrived(servo, data)

    def _fast_answers(self, size: int, servos: set[int]) -> dict[int, bytes]:
        whole = (size + 4) * len(servos)  # error, id, data, CRC of each
        packet, result = self._sdk.rxPacket(self._port, True)
        if result != COMM_SUCCESS or packet[4] != BROADCAST_ID or len(packet) != ERROR_AT + whole:
            return {}
        data, found = packet[ERROR_AT:], {}
        for start in range(0, whole, size + 4):
            error, servo = data[start], data[start + 1]
            self._note(servo, error)
            if servo in servos and not error & ~ALERT:
                found[servo] = bytes(data[start + 2 : start + 2 + size])
        return found

    def _answers(self, size: int, servos: set[int]) -> dict[int, bytes]:
        found: dict[int, bytes] = {}
        while len(found) < len(servos):
            packet, result = self._sdk.rxPacket(self._port, False)
            if result != COMM_SUCCESS:
                break
            servo, error, data = _parts(packet)
            self._note(servo, error)
            if servo in servos and not error & ~ALERT and len(data) == size:
                found[servo] = data
        return found

    def _note(self, servo: int, error: int) -> None:
        (self.alerts.add if error & ALERT else self.alerts.discard)(servo)

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """Turn the errors of a lost device into BusLost; leave the port free for the next call."""
        try:
            yield
        except BusLost:
            raise
        except (OSError, termios.error, serial.SerialException, TypeError) as error:
            # pyserial raises TypeError for a port that another call has closed
            raise BusLost(f"{self.device}: {_reason(error)}") from None
        finally:
            self._port.is_using = False


def _parts(packet: Sequence[int]) -> tuple[int, int, bytes]:
    """Return id, error and data of a status packet."""
    return packet[4], packet[ERROR_AT], bytes(packet[ERROR_AT + 1 : -2])


def _bytes(value: int, size: int) -> bytes:
    return unsigned(value, size).to_bytes(size, "little")


def _reason(error: Exception) -> str:
    number = error.args[0] if isinstance(error, termios.error) else getattr(error, "errno", None)
    if number == errno.ENOENT:
        return "does not exist"
    if number == errno.EACCES:
        return "no permission; add the user to the group dialout"
    return os.strerror(number) if isinstance(number, int) else " ".join(str(error).split())
