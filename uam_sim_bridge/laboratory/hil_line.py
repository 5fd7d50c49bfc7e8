"""Sensors and motors of a flight controller in HITL over a serial line of its own, as its USB.

In the place of `HilServer`. The autopilot has its own clock: no tick waits for it, and its newest
motor commands count. The ground station is on this line, too.

PX4 as a vehicle needs it (config/px4/vehicle.yaml) requires the heartbeat of a ground station, a
radio or joystick, and a global position, whose origin the ground station sets. An origin that comes
before EKF2's height is valid loses its altitude, and PX4 does not arm: it is sent until PX4
reports it complete.
"""

import math
import select
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from uam_sim_bridge.devices.serial.serial_cable import PseudoTerminal
from uam_sim_bridge.mavlink.hil.hil_messages import HilMessages
from uam_sim_bridge.mavlink.protocol.wire import Codec, Message, mavlink2

SYSTEM, COMPONENT = 255, 190  # of a ground station
HEARTBEAT_PERIOD, STICKS_PERIOD = 1.0, 0.05  # [s]; PX4 regards sticks as lost after 0.5 s
ORIGIN_PERIOD = 2.0  # [s] until PX4 reports the origin complete
CENTRED = 500  # throttle of MANUAL_CONTROL, 0 to 1000
# of the room: any place will do; the same as that of the simulated magnetometer and barometer
LATITUDE, LONGITUDE, ALTITUDE = 473977420, 85455940, 488000  # [1e-7 deg], [mm]
NEAR = 100, 100, 1000  # differences of a reported origin, in the same units: PX4 rounds
SILENT = 3.0  # [s] without any message: the autopilot is gone; its heartbeat comes every second
STOPPED = 0.5  # [s] without motor commands while armed: the motors stop
SLICE = 0.1  # [s] longest wait at once


class GroundStation:
    """Sends heartbeats, centred sticks and the origin; `origin_known`: PX4 has it."""

    def __init__(self, autopilot: int = 1) -> None:
        """autopilot: its MAVLink system id."""
        self._autopilot = autopilot
        self.origin_known = False
        self._next = dict.fromkeys(("heartbeat", "sticks", "origin"), 0.0)

    def due(self, now: float) -> list[Message]:
        """Return the messages to send at `now` [s]."""
        found = []
        if self._at("heartbeat", now, HEARTBEAT_PERIOD):
            kind, none = mavlink2.MAV_TYPE_GCS, mavlink2.MAV_AUTOPILOT_INVALID
            active = mavlink2.MAV_STATE_ACTIVE
            found.append(mavlink2.MAVLink_heartbeat_message(kind, none, 0, 0, active, 3))
        if self._at("sticks", now, STICKS_PERIOD):
            found.append(
                mavlink2.MAVLink_manual_control_message(self._autopilot, 0, 0, CENTRED, 0, 0)
            )
        if not self.origin_known and self._at("origin", now, ORIGIN_PERIOD):
            found.append(
                mavlink2.MAVLink_set_gps_global_origin_message(
                    self._autopilot, LATITUDE, LONGITUDE, ALTITUDE
                )
            )
        return found

    def take(self, message: Message) -> None:
        """Take a message of the autopilot; a complete origin stays known."""
        if message.get_type() != "GPS_GLOBAL_ORIGIN" or self.origin_known:
            return
        reported = message.latitude, message.longitude, message.altitude
        sent = LATITUDE, LONGITUDE, ALTITUDE
        self.origin_known = all(
            abs(has - given) <= near for has, given, near in zip(reported, sent, NEAR, strict=True)
        )

    def _at(self, what: str, now: float, period: float) -> bool:
        """Return whether `what` is due, at most once per `period` [s]."""
        if now < self._next[what]:
            return False
        self._next[what] = now + period
        return True


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
        self._terminal.close()

    def _take(self) -> None:
        while data := self._terminal.read():
            for message in self._framer.stream(data):
                self._heard = self._clock()
                self._station.take(message)
                if self.take(message):
                    self._commanded = self._heard
