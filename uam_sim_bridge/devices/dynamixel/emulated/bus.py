"""The emulated bus: a line of servos behind a pseudo-terminal, with its timing.

The driver opens `EmulatedBus.port`, a device like /dev/ttyUSB0. One thread serves the other end.
"""

from __future__ import annotations

import select
import termios
import time
from collections.abc import Sequence
from pathlib import Path

from uam_sim_bridge.devices.dynamixel.control_table import BAUD_RATES
from uam_sim_bridge.devices.dynamixel.emulated.line import ServoLine
from uam_sim_bridge.devices.dynamixel.emulated.servo import EmulatedServo
from uam_sim_bridge.devices.serial.pseudo_terminal import DeviceThread, PseudoTerminal
from uam_sim_bridge.devices.serial.serial_port import BITS_PER_BYTE

IDLE = 0.01  # [s] between two looks at the watchdogs of a silent bus
_SPEEDS = {
    getattr(termios, f"B{rate}"): rate for rate in BAUD_RATES if hasattr(termios, f"B{rate}")
}


class EmulatedBus:
    """A pseudo-terminal with servos; `timing`: answers take as long as on the wire.

    `line`: the servos and their faults; `port`: path of the device.
    """

    def __init__(
        self,
        servos: Sequence[EmulatedServo],
        timing: bool = False,
        latency_timer: float = 0.0,
        seed: int = 1,
        link: Path | None = None,
    ) -> None:
        """latency_timer [s] of the USB adapter, before an answer; seed: of the faults; link: a path
        that stays the same when the cable is unplugged and plugged in again."""
        self.line = ServoLine(servos, seed)
        self._timing, self._latency, self._link = timing, latency_timer, link
        self._terminal: PseudoTerminal | None = None
        self.port = ""
        self._thread = DeviceThread("emulated bus", self._serve)
        self.plug_in()
        self._thread.start()

    def __enter__(self) -> EmulatedBus:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def plug_in(self) -> None:
        """Create the device; its path is `port`."""
        with self._thread.changed():
            if self._terminal is None:
                self._terminal = PseudoTerminal(self._link)
                self.port = self._terminal.path

    def unplug(self) -> None:
        """Remove the device, as a pulled USB cable; the servos keep their supply."""
        with self._thread.changed():
            if self._terminal is not None:
                self._terminal.close()
            self._terminal = None

    def close(self) -> None:
        """End the thread and remove the device."""
        self._thread.end()
        self.unplug()

    def _serve(self) -> None:
        """Answer what comes, or let the watchdogs of a silent bus run."""
        if self._terminal is None:
            time.sleep(IDLE)
        if self._terminal is None or not select.select([self._terminal], [], [], IDLE)[0]:
            self.line.tick()
        else:
            self._answer(self._terminal, time.monotonic())

    def _answer(self, terminal: PseudoTerminal, started: float) -> None:
        """Hand the bytes to the line; send the answers at their times.

        An adapter with a latency timer keeps what it receives within this time, and hands it over
        at once.
        """
        data, speed = terminal.read(), _SPEEDS.get(terminal.speed)
        sent = started + self._duration(len(data), speed) + self._latency
        first, kept = sent, b""
        for delay, answer in self.line.receive(data, speed):
            due = sent + delay + self._duration(len(answer), speed)
            if kept and due > first + self._latency:
                self._send(terminal, kept, sent)
                kept = b""
            if not kept:
                first = due
            kept, sent = kept + answer, due
        if kept:
            self._send(terminal, kept, sent)

    def _send(self, terminal: PseudoTerminal, data: bytes, at: float) -> None:
        """Hand over bytes at `at` [s], with timing."""
        left = at - time.monotonic()
        if self._timing and left > 0.0:
            time.sleep(left)
        terminal.write(data)

    def _duration(self, count: int, speed: int | None) -> float:
        return BITS_PER_BYTE * count / speed if self._timing and speed else 0.0
