"""The emulated bus: a line of servos behind a pseudo-terminal, with its timing.

The driver opens `EmulatedBus.port`, a device like /dev/ttyUSB0. One thread serves the other end.
"""

from __future__ import annotations

import contextlib
import os
import pty
import select
import termios
import threading
import time
import tty
from collections.abc import Iterator, Sequence
from pathlib import Path

from uam_sim_bridge.drivers.dynamixel.control_table import BAUD_RATES
from uam_sim_bridge.emulation.dynamixel.line import ServoLine
from uam_sim_bridge.emulation.dynamixel.servo import EmulatedServo

BITS_PER_BYTE = 10  # start, 8 data, stop
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
        self._lock = threading.Lock()
        self._stop, self._pause = threading.Event(), threading.Event()
        self._master: int | None = None
        self._slave: int | None = None
        self.port = ""
        self.plug_in()
        self._thread = threading.Thread(target=self._serve, name="emulated bus", daemon=True)
        self._thread.start()

    def __enter__(self) -> EmulatedBus:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def plug_in(self) -> None:
        """Create the device; its path is `port`."""
        with self._changed():
            if self._master is not None:
                return
            self._master, self._slave = pty.openpty()
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self.port = os.ttyname(self._slave)
            if self._link is not None:
                self._link.unlink(missing_ok=True)
                self._link.symlink_to(self.port)
                self.port = str(self._link)

    def unplug(self) -> None:
        """Remove the device, as a pulled USB cable; the servos keep their supply."""
        with self._changed():
            for end in (self._master, self._slave):
                if end is not None:
                    os.close(end)
            self._master = self._slave = None
            if self._link is not None:
                self._link.unlink(missing_ok=True)

    def close(self) -> None:
        """End the thread and remove the device."""
        self._stop.set()
        self._thread.join()
        self.unplug()

    @contextlib.contextmanager
    def _changed(self) -> Iterator[None]:
        """Keep the thread away from the device while it is created or removed."""
        self._pause.set()
        with self._lock:
            yield
        self._pause.clear()

    def _serve(self) -> None:
        while not self._stop.is_set():
            if self._pause.is_set():
                time.sleep(IDLE)
                continue
            with self._lock:
                if self._master is None or not select.select([self._master], [], [], IDLE)[0]:
                    self.line.tick()
                else:
                    with contextlib.suppress(OSError):  # the host has closed its end
                        self._answer(os.read(self._master, 4096), time.monotonic())
            if self._master is None:
                time.sleep(IDLE)

    def _answer(self, data: bytes, started: float) -> None:
        """Hand the bytes to the line; send each answer at its time."""
        speed = _SPEEDS.get(termios.tcgetattr(self._slave)[5])
        sent = started + self._duration(len(data), speed) + self._latency
        for delay, answer in self.line.receive(data, speed):
            sent += delay + self._duration(len(answer), speed)
            left = sent - time.monotonic()
            if self._timing and left > 0.0:
                time.sleep(left)
            os.write(self._master, answer)

    def _duration(self, count: int, speed: int | None) -> float:
        return BITS_PER_BYTE * count / speed if self._timing and speed else 0.0
