"""Instructions to Dynamixel servos by Protocol 2.0.

An answer has no number that names its instruction. After a stall of the computer or of the adapter
the answer to an instruction that was given up may come in place of the next one: see `Overdue`.
"""

import termios
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TypeVar

import serial

from uam_sim_bridge.devices.dynamixel import protocol
from uam_sim_bridge.devices.dynamixel.control_table import Register
from uam_sim_bridge.devices.dynamixel.protocol import (
    ALERT,
    BROADCAST,
    STATUS,
    Packet,
    PacketReader,
    word,
)
from uam_sim_bridge.devices.serial.serial_port import SerialPort
from uam_sim_bridge.ports import serial_problem

EMPTY_STATUS = 11  # bytes of a status packet without data
FAST_HEAD = 8  # bytes of the answer to a Fast Sync Read before its first error
SCAN_SLOT = 0.003  # [s] for each id of a broadcast ping
ATTEMPTS = 3  # pings and reads at the start: a single bit error is no missing servo
LATEST = 1.0  # [s] an answer comes within this time, or it is lost
REFUSALS = {
    1: "the servo could not execute it",
    2: "unknown instruction",
    3: "the instruction arrived damaged",
    4: "value out of range",
    5: "wrong length",
    6: "value beyond its limit register",
    7: "not accessible; EEPROM is locked while torque is on",
}

T = TypeVar("T")


class BusLost(OSError):
    """The device is gone or cannot be opened; the text is one line."""


class NoAnswer(RuntimeError):
    """A servo did not answer, or its answer was damaged; the text is one line."""

    def __init__(self, text: str, damaged: bool = False) -> None:
        super().__init__(text)
        self.damaged = damaged


class Refused(RuntimeError):
    """A servo refused an instruction; the text is one line."""


@dataclass(frozen=True)
class Instruction:
    """An instruction to one servo; size: bytes of data in its answer."""

    packet: Packet
    size: int


class Overdue:
    """The instructions whose answers were given up in the last second; true if there are any.

    An answer that is given up may still come: after a stall it lies in front of the answer to the
    next instruction, and would be taken for it. A servo answers in the order of its instructions,
    so the oldest overdue one comes first.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """clock: seconds."""
        self._clock = clock
        self._waiting: deque[tuple[float, Instruction]] = deque()

    def __bool__(self) -> bool:
        while self._waiting and self._waiting[0][0] < self._clock() - LATEST:
            self._waiting.popleft()
        return bool(self._waiting)

    def add(self, instruction: Instruction) -> None:
        """Note that the answer to `instruction` is given up."""
        self._waiting.append((self._clock(), instruction))

    def arrived(self, servo: int, data: bytes) -> set[Instruction]:
        """Return the instructions to which an answer can belong; the oldest one is then settled.

        An answer may also be lost for ever, so it need not belong to the oldest one.
        """
        if not self:
            return set()
        pairs = [p for p in self._waiting if p[1].packet.id == servo and p[1].size == len(data)]
        if pairs:
            self._waiting.remove(pairs[0])
        return {instruction for _, instruction in pairs}

    def answers(self, instruction: Instruction, servo: int, data: bytes, refused: bool) -> bool:
        """Return whether an answer is the one to `instruction`, the newest one.

        refused: it has an error, and then no data. An answer counts also if it can only belong to
        an equal instruction; that of the newest one is then overdue.
        """
        late = self.arrived(servo, data)
        if servo != instruction.packet.id:
            return False
        if not late:
            return refused or len(data) == instruction.size
        if late == {instruction}:
            self.add(instruction)
            return True
        return False


class DynamixelBus:
    """A line with servos that understand Protocol 2.0; not for several threads at once."""

    def __init__(
        self, device: str, baud_rate: int, allowance: float, port: SerialPort | None = None
    ) -> None:
        """allowance [s]: time of an answer beside its bytes; port: in place of a serial device."""
        self.device, self.baud_rate = device, baud_rate
        self.port = port or SerialPort(device, allowance)
        self.alerts: set[int] = set()  # ids whose last answer reported a hardware error
        self._overdue = Overdue()
        self._reader, self._read = PacketReader(), deque[Packet]()
        self._heard = False  # bytes since the last instruction

    def open(self) -> None:
        """Open the device. Raises BusLost."""
        with self.guarded():
            try:
                self.port.open(self.baud_rate)
            except ValueError:
                raise BusLost(f"{self.device}: no baud rate {self.baud_rate}") from None

    def set_baud_rate(self, baud_rate: int) -> None:
        """Use another baud rate from now on. Raises BusLost."""
        self.baud_rate = baud_rate
        self.open()

    def close(self) -> None:
        self.port.close()

    @contextmanager
    def patient(self, allowance: float) -> Iterator[None]:
        """Give each answer at least `allowance` [s] beside the time of its bytes."""
        usual = self.port.allowance
        self.port.allowance = max(usual, allowance)
        try:
            yield
        finally:
            self.port.allowance = usual

    def read(self, servo: int, register: Register) -> int:
        """Return the unsigned value of a register. Raises NoAnswer, Refused, BusLost."""
        return int.from_bytes(self.read_bytes(servo, register), "little")

    def read_signed(self, servo: int, register: Register) -> int:
        """Return the signed value of a register. Raises NoAnswer, Refused, BusLost."""
        return int.from_bytes(self.read_bytes(servo, register), "little", signed=True)

    def write(self, servo: int, register: Register, value: int) -> None:
        """Write a signed value and wait for the status. Raises NoAnswer, Refused, BusLost."""
        data = word(register.address, 2) + word(value, register.size)
        self._ask(Packet(servo, protocol.WRITE, data), 0)

    @contextmanager
    def guarded(self) -> Iterator[None]:
        """Turn the errors of a lost device into BusLost."""
        try:
            yield
        except BusLost:
            raise
        except (OSError, termios.error, serial.SerialException, TypeError) as error:
            # pyserial raises TypeError for a port that another call has closed
            raise BusLost(f"{self.device}: {serial_problem(error)}") from None

    def ping(self, servo: int) -> int:
        """Return the model number of a servo. Raises NoAnswer, BusLost."""
        data = self._ask(Packet(servo, protocol.PING), 3)  # model number and firmware
        return int.from_bytes(data[:2], "little")

    def scan(self) -> dict[int, tuple[int, int]]:
        """Return id → (model number, firmware) of all servos. Raises BusLost.

        It takes 0.8 s, and longer at low baud rates.
        """
        found, answer = dict[int, bytes](), EMPTY_STATUS + 3
        with self.guarded(), self.patient(SCAN_SLOT * BROADCAST):
            self._send(Packet(BROADCAST, protocol.PING), answer * BROADCAST)
            while data := self.port.read():
                for packet in self._reader.feed(data):
                    found[packet.id] = packet.parameters[1:]
        return {
            servo: (int.from_bytes(data[:2], "little"), data[2])
            for servo, data in sorted(found.items())
            if len(data) == 3
        }

    def read_bytes(self, servo: int, register: Register) -> bytes:
        """Return the bytes of a register. Raises NoAnswer, Refused, BusLost."""
        return self._ask(Packet(servo, protocol.READ, _place(register)), register.size)

    def sync_write(self, register: Register, values: Mapping[int, int]) -> None:
        """Write a signed value to each servo, without an answer. Raises BusLost."""
        goals = b"".join(
            bytes([servo]) + word(value, register.size) for servo, value in values.items()
        )
        with self.guarded():
            packet = Packet(BROADCAST, protocol.SYNC_WRITE, _place(register) + goals)
            self.port.send(packet.encode())

    def sync_read(self, register: Register, servos: Sequence[int], fast: bool) -> dict[int, bytes]:
        """Return id → bytes of the servos that answered. Raises BusLost.

        fast: Fast Sync Read, one packet for all, which one silent servo spoils.
        """
        size, count = register.size, len(servos)
        code = protocol.FAST_SYNC_READ if fast else protocol.SYNC_READ
        expected = FAST_HEAD + count * (size + 4) if fast else count * (size + EMPTY_STATUS)
        with self.guarded():
            self._send(Packet(BROADCAST, code, _place(register) + bytes(servos)), expected)
            read = self._fast_answers if fast else self._answers
            return read(size, set(servos))

    def reboot(self, servo: int) -> None:
        """Restart a servo. Raises NoAnswer, BusLost."""
        with suppress(Refused):
            self._ask(Packet(servo, protocol.REBOOT), 0)
        self.alerts.discard(servo)

    def _ask(self, packet: Packet, size: int) -> bytes:
        """Ask one servo; return the `size` bytes of its data. Raises NoAnswer, Refused, BusLost."""
        instruction = Instruction(packet, size)
        with self.guarded():
            self._drop_late()
            self._send(packet, size + EMPTY_STATUS)
            while (answer := self._packet()) is not None:
                servo, error, data = _parts(answer)
                code = error & ~ALERT
                if self._overdue.answers(instruction, servo, data, bool(code)):
                    self._note(servo, error)
                    if code:
                        raise Refused(f"id {servo}: {REFUSALS.get(code, f'error {code}')}")
                    return data
        if not self._heard or self._overdue:  # the damaged one may be an overdue one
            self._overdue.add(instruction)
        if self._heard:
            raise NoAnswer(f"id {packet.id}: the answer arrives damaged", damaged=True)
        raise NoAnswer(f"id {packet.id}: no answer")

    def _send(self, packet: Packet, size: int) -> None:
        """Send an instruction; begin to wait for answers of `size` bytes."""
        self._reader, self._heard = PacketReader(), False
        self._read.clear()
        self.port.send(packet.encode())
        self.port.expect(size)

    def _packet(self) -> Packet | None:
        """Return the next status packet; None if it is late or damaged."""
        while not self._read:
            damaged, data = self._reader.damaged, self.port.read()
            found = self._reader.feed(data)
            self._read += [one for one in found if one.instruction == STATUS and one.parameters]
            self._heard |= bool(data)
            if not data or (self._reader.damaged > damaged and not self._read):
                return None
        self._heard = False
        return self._read.popleft()

    def _drop_late(self) -> None:
        """Take the answers that have come since the last instruction was given up."""
        self.port.look()
        while self._overdue and (packet := self._packet()) is not None:
            servo, _, data = _parts(packet)
            self._overdue.arrived(servo, data)

    def _fast_answers(self, size: int, servos: set[int]) -> dict[int, bytes]:
        packet, each = self._packet(), size + 4  # error, id, data, CRC of each
        if packet is None or packet.id != BROADCAST:
            return {}
        if len(packet.parameters) != len(servos) * each - 2:  # the last CRC is the packet's
            return {}
        found = {}
        for start in range(0, len(packet.parameters), each):
            error, servo, *data = packet.parameters[start : start + each - 2]
            self._note(servo, error)
            if servo in servos and not error & ~ALERT:
                found[servo] = bytes(data)
        return found

    def _answers(self, size: int, servos: set[int]) -> dict[int, bytes]:
        found: dict[int, bytes] = {}
        while len(found) < len(servos) and (packet := self._packet()) is not None:
            servo, error, data = _parts(packet)
            self._note(servo, error)
            if servo in servos and not error & ~ALERT and len(data) == size:
                found[servo] = data
        return found

    def _note(self, servo: int, error: int) -> None:
        (self.alerts.add if error & ALERT else self.alerts.discard)(servo)


def tried(call: Callable[..., T], *arguments: object) -> T:
    """Return call(*arguments); repeat it when the answer is missing. Raises NoAnswer."""
    for _ in range(ATTEMPTS - 1):
        try:
            return call(*arguments)
        except NoAnswer:
            continue
    return call(*arguments)


def _parts(packet: Packet) -> tuple[int, int, bytes]:
    """Return id, error and data of a status packet."""
    return packet.id, packet.parameters[0], packet.parameters[1:]


def _place(register: Register) -> bytes:
    return word(register.address, 2) + word(register.size, 2)
