"""A serial cable between two programs: two pseudo-terminals, with the timing of the baud rate.

The programs open `near` and `far`, devices like /dev/ttyUSB0. One thread carries the bytes. The
near end is a USB adapter: unplugged, its device is gone. A cut cable is silent, both devices stay.
"""

from __future__ import annotations

import select
import time
from collections import deque
from pathlib import Path

import numpy as np

from uam_sim_bridge.devices.serial.pseudo_terminal import DeviceThread, PseudoTerminal
from uam_sim_bridge.devices.serial.serial_port import BITS_PER_BYTE

IDLE = 0.02  # [s] longest wait
HELD = 65536  # bytes under way in one direction; a UART's sender would wait


def disturbed(data: bytes, rate: float, noise: np.random.Generator) -> bytes:
    """Return `data` with each bit inverted with probability `rate`."""
    if not rate or not data:
        return data
    flips = noise.random(8 * len(data)) < rate
    return (np.frombuffer(data, np.uint8) ^ np.packbits(flips)).tobytes()


class Wire:
    """One direction: when each chunk has arrived at the other end.

    A chunk occupies the wire for its length at the baud rate, after those before it.
    """

    def __init__(self, baud: int) -> None:
        """baud [bit/s]."""
        self._second = BITS_PER_BYTE / baud  # per byte
        self._free = 0.0  # [s] when the last byte has left
        self._under_way: deque[tuple[float, bytes]] = deque()
        self.held = 0  # bytes under way

    def put(self, data: bytes, now: float) -> None:
        """Take a chunk at `now` [s]."""
        self._free = max(self._free, now) + len(data) * self._second
        self._under_way.append((self._free, data))
        self.held += len(data)

    def take(self, now: float) -> bytes:
        """Return the bytes that have arrived by `now` [s]."""
        found = b""
        while self._under_way and self._under_way[0][0] <= now:
            found += self._under_way.popleft()[1]
        self.held -= len(found)
        return found

    @property
    def due(self) -> float | None:
        """Return when the next bytes arrive [s], None without any."""
        return self._under_way[0][0] if self._under_way else None

    def clear(self) -> None:
        """Lose the bytes under way."""
        self._under_way.clear()
        self.held = 0


class SerialCable:
    """`near`, `far`: paths of the devices; `bit_error_rate`: of every bit, in both directions."""

    def __init__(self, near: Path, far: Path, baud: int, seed: int = 1) -> None:
        """near, far: paths to create, which stay the same when the cable is plugged in again."""
        self.near, self.far = near, far
        self.bit_error_rate = 0.0
        self.cut = False
        self.carried = [0, 0]  # bytes from the near and from the far end
        self._noise = np.random.default_rng(seed)
        self._wires = Wire(baud), Wire(baud)  # from the near end, from the far end
        self._thread = DeviceThread("serial cable", self._carry)
        self._ends: list[PseudoTerminal | None] = [PseudoTerminal(near), PseudoTerminal(far)]
        self._thread.start()

    def __enter__(self) -> SerialCable:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def unplug(self) -> None:
        """Remove the near device, as a pulled USB adapter."""
        with self._thread.changed():
            self._remove(0)

    def plug_in(self) -> None:
        """Create the near device again, under the same path."""
        with self._thread.changed():
            if self._ends[0] is None:
                self._ends[0] = PseudoTerminal(self.near)

    def close(self) -> None:
        """End the thread and remove the devices."""
        self._thread.end()
        for end in (0, 1):
            self._remove(end)

    def _remove(self, end: int) -> None:
        terminal = self._ends[end]
        if terminal is not None:
            terminal.close()
        self._ends[end] = None
        for wire in self._wires:
            wire.clear()

    def _carry(self) -> None:
        """Wait for bytes, and carry those that are due."""
        open_ends = [
            terminal
            for terminal, wire in zip(self._ends, self._wires, strict=True)
            if terminal is not None and wire.held < HELD
        ]
        due = [wire.due for wire in self._wires if wire.due is not None]
        wait = min([IDLE, *(max(0.0, one - time.monotonic()) for one in due)])
        readable = select.select(open_ends, [], [], wait)[0] if open_ends else []
        if not open_ends:
            time.sleep(wait)
        for end, wire in enumerate(self._wires):
            terminal, other = self._ends[end], self._ends[1 - end]
            if terminal in readable:
                data = terminal.read()
                self.carried[end] += len(data)
                if not self.cut and other is not None:
                    wire.put(disturbed(data, self.bit_error_rate, self._noise), time.monotonic())
            arrived = wire.take(time.monotonic())
            if arrived and other is not None:
                other.write(arrived)
