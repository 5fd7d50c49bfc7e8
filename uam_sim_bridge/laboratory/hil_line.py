"""Sensors and motors of a flight controller in HITL over a serial line of its own, as its USB.

In the place of `HilServer`. The autopilot has its own clock: no tick waits for it, and its newest
motor commands count. The ground station is on this line, too.
"""

from __future__ import annotations

import math
import select
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from uam_sim_bridge.devices.serial.pseudo_terminal import PseudoTerminal
from uam_sim_bridge.laboratory.ground_station import COMPONENT, SYSTEM, GroundStation
from uam_sim_bridge.mavlink.hil.hil_messages import HilMessages
from uam_sim_bridge.mavlink.protocol.wire import Codec

SILENT = 3.0  # [s] without any message: the autopilot is gone; its heartbeat comes every second
STOPPED = 0.5  # [s] without motor commands while armed: the motors stop
SLICE = 0.1  # [s] longest wait at once


class HilLine(HilMessages):
    """The simulator's end of the line; `path`: the device for the autopilot."""

    def __init__(
        self, device: Path, motors: int, seed: int, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """device: path to create; motors: their number; seed: of the noise; clock: seconds."""
        super().__init__(motors, seed)
        self._terminal = PseudoTerminal(device)
        self.path = self._terminal.path
        self._clock = clock
        self._station, self._codec_of_station = GroundStation(), Codec(SYSTEM, COMPONENT)
        self._heard = self._commanded = -math.inf  # [s] newest message, newest motor commands

    @property
    def connected(self) -> bool:
        """Return whether the autopilot is there: it has sent something lately."""
        return self._clock() - self._heard < SILENT

    def accept(self, timeout: float) -> bool:
        """Wait up to `timeout` [s] for a message; return whether the autopilot is there."""
        if select.select([self._terminal], [], [], min(timeout, SLICE))[0]:
            self._take()
        return self.connected

    def _put(self, data: bytes) -> None:
        for message in self._station.due(self._clock()):
            data += self._codec_of_station.encode(message)
        self._terminal.write(data)

    def receive(self, _: float = 0.0) -> np.ndarray:
        """Return the newest motor commands (n,), zeros without an autopilot; waits for nothing."""
        self._take()
        if not self.connected or (self.armed and self._clock() - self._commanded > STOPPED):
            return self.forget()
        return self.motors

    def close(self) -> None:
        """Remove the device."""
        self._terminal.close()

    def _take(self) -> None:
        while data := self._terminal.read():
            for message in self.received(data):
                self._heard = self._clock()
                self._station.take(message)
                if self.take(message):
                    self._commanded = self._heard
