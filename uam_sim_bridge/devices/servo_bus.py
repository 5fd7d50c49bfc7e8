"""A bus of servos: what a driver does with it, whatever the make.

A make is a class after `ServoBus` in a folder of its own, with a protocol that its emulated servos
use, too: see `dynamixel`.
"""

import errno
import os
import termios
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

import serial

from uam_sim_bridge.devices.serial.serial_port import SerialPort

ATTEMPTS = 3  # pings and reads at the start: a single bit error is no missing servo

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


class ServoBus(ABC):
    """The line with its servos; not for several threads at once.

    `alerts`: ids whose last answer reported a hardware error.
    """

    def __init__(
        self, device: str, baud_rate: int, allowance: float, port: SerialPort | None = None
    ) -> None:
        """allowance [s]: time that an answer has beside the time of its bytes; port: in place of a
        serial device."""
        self.device, self.baud_rate = device, baud_rate
        self.port = port or SerialPort(device, allowance)
        self.alerts: set[int] = set()

    @abstractmethod
    def ping(self, servo: int) -> int:
        """Return the model number of a servo. Raises NoAnswer, BusLost."""

    @abstractmethod
    def scan(self) -> dict[int, tuple[int, int]]:
        """Return id → (model number, firmware) of all servos. Raises BusLost."""

    @abstractmethod
    def read_bytes(self, servo: int, register: Register) -> bytes:
        """Return the bytes of a register. Raises NoAnswer, Refused, BusLost."""

    @abstractmethod
    def write_bytes(self, servo: int, register: Register, data: bytes) -> None:
        """Write a register and wait for the status. Raises NoAnswer, Refused, BusLost."""

    @abstractmethod
    def sync_read(self, register: Register, servos: Sequence[int], fast: bool) -> dict[int, bytes]:
        """Return id → bytes of the servos that answered. Raises BusLost.

        fast: one packet for all, where the make has it: one silent servo spoils it.
        """

    @abstractmethod
    def sync_write(self, register: Register, values: Mapping[int, int]) -> None:
        """Write a signed value to each servo, without an answer. Raises BusLost."""

    @abstractmethod
    def reboot(self, servo: int) -> None:
        """Restart a servo. Raises NoAnswer, BusLost."""

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
        """Close the device."""
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
        self.write_bytes(servo, register, word(value, register.size))

    @contextmanager
    def guarded(self) -> Iterator[None]:
        """Turn the errors of a lost device into BusLost."""
        try:
            yield
        except BusLost:
            raise
        except (OSError, termios.error, serial.SerialException, TypeError) as error:
            # pyserial raises TypeError for a port that another call has closed
            raise BusLost(f"{self.device}: {_reason(error)}") from None


def tried(call: Callable[..., T], *arguments: object) -> T:
    """Return call(*arguments); repeat it when the answer is missing. Raises NoAnswer."""
    for _ in range(ATTEMPTS - 1):
        try:
            return call(*arguments)
        except NoAnswer:
            continue
    return call(*arguments)


def word(value: int, size: int) -> bytes:
    """Return a signed or unsigned value as `size` bytes, the lowest first."""
    return (value & ((1 << 8 * size) - 1)).to_bytes(size, "little")


def _reason(error: Exception) -> str:
    number = error.args[0] if isinstance(error, termios.error) else getattr(error, "errno", None)
    if number == errno.ENOENT:
        return "does not exist"
    if number == errno.EACCES:
        return "no permission; add the user to the group dialout"
    return os.strerror(number) if isinstance(number, int) else " ".join(str(error).split())
