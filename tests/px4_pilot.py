"""A pilot with a radio and a ground station, at the ground station's port of a real PX4."""

from __future__ import annotations

import math
import socket
import struct
import threading
import time

from uam_control.offboard.firmware import FIRMWARES
from uam_control.offboard.modes import MavCmd, Mode
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, mavlink2

PORT = 14550  # of PX4's ground station, whatever its instance
BEAT = 0.03  # [s] wall time between two MANUAL_CONTROL; PX4 counts them lost after COM_RC_LOSS_T
ORIGIN = 473566100, 85461800, 408000  # latitude, longitude [1e-7 deg], altitude [mm]
PATIENCE = 100.0  # [s] wall time
AGAIN = 0.3  # [s] after which a choice that had no effect is repeated
LOW_BATTERY = {
    "COM_LOW_BAT_ACT": 2,
    "CBRK_SUPPLY_CHK": 0,
    "BAT_LOW_THR": 0.7,
    "BAT_CRIT_THR": 0.6,
    "SIM_BAT_MIN_PCT": 30.0,
    "SIM_BAT_DRAIN": 3.0,
}  # PX4 lands long before the supervisor's own limit of 15 %
KILL_SWITCH = [
    *("COM_RC_IN_MODE=0", "RC_MAP_KILL_SW=7", "RC_CHAN_CNT=8"),
    *("RC_MAP_ROLL=1", "RC_MAP_PITCH=2", "RC_MAP_THROTTLE=3", "RC_MAP_YAW=4"),
]  # a radio whose channels come over MAVLink


class Pilot:
    """Sends sticks in their middle; from `act` on chooses a mode, drains the battery, or kills.

    `modes`: (time since arming [s], mode) of every change, as PX4 reports them to a ground station:
    once a second; `acted` [s] or None.
    """

    def __init__(self, system: int, mode: Mode | None = None, kill: float | None = None) -> None:
        """system: of PX4; mode: None for the battery; kill [s]: how long the kill switch is on."""
        self.modes: list[tuple[float, Mode]] = []
        self.acted: float | None = None
        self._system, self._at, self._mode, self._kill = system, math.inf, mode, kill
        self._codec = Codec(255, mavlink2.MAV_COMP_ID_MISSIONPLANNER)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", PORT))
        self._socket.settimeout(BEAT)
        self._peer: tuple[str, int] | None = None
        self._now = self._armed = None
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def since_acted(self) -> list[Mode]:
        """The modes since the pilot acted, in order."""
        return [mode for when, mode in self.modes if self.acted is not None and when >= self.acted]

    def act(self) -> None:
        """Choose the mode."""
        self._at = self.since

    def wait(self, seconds: float) -> None:
        """Wait until the pilot acted that long ago [s], by PX4's clock."""
        end = time.monotonic() + PATIENCE
        while self.acted is None or self.since < self.acted + seconds:
            assert time.monotonic() < end, "PX4's clock stands still"
            time.sleep(0.01)

    def close(self) -> None:
        """Switch the radio off."""
        self._over.set()
        self._thread.join()
        self._socket.close()

    def _run(self) -> None:
        framer, beat, beats = Framer(self._codec), 0.0, 0
        while not self._over.is_set():
            try:
                data, sender = self._socket.recvfrom(65535)
            except TimeoutError:
                data = b""
            for message in framer.datagram(data):
                if message.get_srcSystem() == self._system:
                    self._peer = sender
                    self._take(message)
            if self._peer is not None and time.monotonic() - beat > BEAT:
                beat, beats = time.monotonic(), beats + 1
                if beats < 40:
                    self._set("COM_RC_IN_MODE", int(self._kill is None))
                    self._send(
                        mavlink2.MAVLink_set_gps_global_origin_message(self._system, *ORIGIN)
                    )
                self._sticks()
                self._act()

    def _sticks(self) -> None:
        """Send the sticks: as a joystick, or the channels of a radio with a kill switch."""
        if self._kill is None:
            self._send(mavlink2.MAVLink_manual_control_message(self._system, 0, 0, 500, 0, 0))
            return
        engaged = self.acted is not None and self.since < self.acted + self._kill
        channels = [1500, 1500, 1500, 1500, 1500, 1500, 2000 if engaged else 1000, 1000]
        self._send(mavlink2.MAVLink_rc_channels_override_message(self._system, 1, *channels))

    def _take(self, message) -> None:
        kind = message.get_type()
        if kind in ("ATTITUDE", "ATTITUDE_QUATERNION"):
            self._now = message.time_boot_ms * 1e-3
        if kind == "HEARTBEAT" and message.get_srcComponent() == 1:
            if message.base_mode & mavlink2.MAV_MODE_FLAG_SAFETY_ARMED and self._armed is None:
                self._armed = self._now
        elif kind != "CURRENT_MODE":
            return
        mode = FIRMWARES["px4"].mode(message.custom_mode)
        if not self.modes or self.modes[-1][1] is not mode:
            self.modes.append((self.since, mode))

    @property
    def since(self) -> float:
        """Time since arming [s], negative before."""
        return -1.0 if self._armed is None or self._now is None else self._now - self._armed

    def _act(self) -> None:
        offboard = self.modes and self.modes[-1][1] is Mode.OFFBOARD
        due = self._at if self.acted is None else self.acted + AGAIN
        taken = any(mode is not Mode.OFFBOARD for mode in self.since_acted)
        if not offboard or taken or self.since < due or self.since > self._at + 5 * AGAIN:
            return
        self.acted = self.since if self.acted is None else self.acted
        if self._kill is not None:
            return
        if self._mode is None:
            for name, value in LOW_BATTERY.items():
                self._set(name, value)
            return
        parameters = (*FIRMWARES["px4"].mode_request(self._mode), 0, 0, 0, 0)
        self._send(
            mavlink2.MAVLink_command_long_message(
                self._system, 1, MavCmd.DO_SET_MODE, 0, *parameters
            )
        )

    def _set(self, name: str, value: float) -> None:
        kind = mavlink2.MAV_PARAM_TYPE_REAL32
        if isinstance(value, int):
            kind = mavlink2.MAV_PARAM_TYPE_INT32
            value = struct.unpack("<f", struct.pack("<i", value))[0]
        self._send(mavlink2.MAVLink_param_set_message(self._system, 1, name.encode(), value, kind))

    def _send(self, message) -> None:
        self._socket.sendto(self._codec.encode(message), self._peer)
