"""The bridge's side of the link to the autopilot: heartbeats, commands, texts, parameters, time.

Protocol and transport are apart: `OffboardLink` works on any `Transport`. All times are those of
the control ticks; there are no wall timers.
"""

from __future__ import annotations

import math
import socket
from typing import Protocol

import numpy as np

from uam_sim_bridge.autopilot.modes import CUSTOM_MODE_ENABLED, Command, Mode
from uam_sim_bridge.flight.ports import PortError
from uam_sim_bridge.mavlink.frames import swap_body
from uam_sim_bridge.mavlink.offboard import OffboardSequence, Request
from uam_sim_bridge.mavlink.parameter_check import WATCHED, differences
from uam_sim_bridge.mavlink.setpoint import RateThrustParameters
from uam_sim_bridge.mavlink.vision import vision_message
from uam_sim_bridge.mavlink.wire import (
    Codec,
    Framer,
    Message,
    TextAssembler,
    clean_text,
    mavlink2,
)

HEARTBEAT_PERIOD = 1.0  # s
HEARTBEAT_TIMEOUT = 3.0  # s without one: not connected
PARAMETER_RETRY, PARAMETER_ATTEMPTS = 0.5, 10  # s, times
_NO_ATTITUDE = [1.0, 0.0, 0.0, 0.0]
ATTITUDE_IGNORED = 128  # type_mask of SET_ATTITUDE_TARGET: body rates and thrust count
# asked of the autopilot on connection: message id → interval [s]
INTERVALS = {
    mavlink2.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 0.2,
    mavlink2.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 0.1,
    mavlink2.MAVLINK_MSG_ID_ODOMETRY: 0.1,
}


class Transport(Protocol):
    """What carries the bytes: `receive` returns the datagrams (or chunks) that have arrived."""

    def send(self, data: bytes) -> None: ...

    def receive(self) -> list[bytes]: ...

    def close(self) -> None: ...


class UdpTransport:
    """UDP between a local port and the autopilot's; packets from elsewhere are ignored."""

    def __init__(self, local_port: int, remote: tuple[str, int], host: str = "127.0.0.1") -> None:
        """Raises PortError in one line where the local port is taken."""
        self._remote = (socket.gethostbyname(remote[0]), remote[1])
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, local_port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            reason = getattr(error, "strerror", None) or str(error)
            raise PortError(f"UDP port {local_port} for MAVLink: {reason}; stop the program that "
                            "uses it or choose another instance") from None
        self._socket.setblocking(False)

    def send(self, data: bytes) -> None:
        """Send one datagram; nobody listening is no error."""
        try:
            self._socket.sendto(data, self._remote)
        except (BlockingIOError, ConnectionError):
            pass

    def receive(self) -> list[bytes]:
        """Return the datagrams that have arrived."""
        datagrams = []
        while True:
            try:
                data, sender = self._socket.recvfrom(65535)
            except BlockingIOError:
                return datagrams
            except ConnectionError:  # our last datagram found nobody
                continue
            if sender == self._remote:
                datagrams.append(data)

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()


class OffboardLink:
    """The autopilot as the bridge sees it, and the way to it.

    `armed`, `mode`, `landed`: its latest word; `armed_since` [s] or None: tick at which it was
    first known armed; `values`: by name, those of its parameters that are WATCHED;
    `warnings`: where they disagree with the mapping; `ignored`: messages of other systems.
    """

    def __init__(
        self,
        transport: Transport,
        sequence: OffboardSequence,
        mapping: RateThrustParameters,
        target_system: int = 1,
    ) -> None:
        self.sequence = sequence
        self.mode, self.armed, self.landed = Mode.UNKNOWN, False, True
        self.armed_since: float | None = None
        self.values: dict[str, float] = {}
        self.warnings: tuple[str, ...] = ()
        self.ignored = 0
        self._transport = transport
        self._mapping = mapping
        self._target = target_system
        self._codec = Codec(target_system, mavlink2.MAV_COMP_ID_ONBOARD_COMPUTER)
        self._framer = Framer(self._codec)
        self._texts = TextAssembler()
        self._asked: dict[int, Request] = {}
        self._heard = self._beat = self._parameters_asked = -math.inf
        self._parameter_attempts = 0
        self._set_up = False

    def set_mapping(self, mapping: RateThrustParameters) -> None:
        """Compare the autopilot's parameters with another mapping from now on."""
        self._mapping = mapping
        self.warnings = tuple(differences(mapping, self.values))

    def connected(self, time: float) -> bool:
        """Whether a heartbeat came within the last seconds."""
        return time - self._heard < HEARTBEAT_TIMEOUT

    def poll(self, time: float) -> None:
        """Handle everything that has arrived, at the tick `time` [s]."""
        for data in self._transport.receive():
            for message in self._framer.datagram(data):
                if message.get_srcSystem() != self._target:
                    self.ignored += 1
                else:
                    self._handle(time, message)

    def tick(self, time: float) -> None:
        """Send what is due besides setpoints: heartbeat, requests of the sequence, questions."""
        if time - self._beat >= HEARTBEAT_PERIOD - 1e-9:
            self._beat = time
            self._send(mavlink2.MAVLink_heartbeat_message(
                mavlink2.MAV_TYPE_ONBOARD_CONTROLLER, mavlink2.MAV_AUTOPILOT_INVALID, 0, 0,
                mavlink2.MAV_STATE_ACTIVE, 3))
        connected = self.connected(time)
        if connected:
            self._ask_set_up(time)
        request = self.sequence.update(time, connected, self.armed, self.mode)
        if request is not None:
            self._request(request)

    def send_setpoint(self, rates: np.ndarray, thrust: float, time: float) -> None:
        """Send body rates (3,) [rad/s, FLU] and normalised thrust; raises ValueError on NaN."""
        roll, pitch, yaw = swap_body(rates).tolist()
        if not math.isfinite(roll + pitch + yaw + thrust) or not 0.0 <= thrust <= 1.0:
            raise ValueError(f"setpoint rates {rates} thrust {thrust} must not be sent")
        self._send(mavlink2.MAVLink_set_attitude_target_message(
            round(time * 1e3) & 0xFFFFFFFF, self._target, mavlink2.MAV_COMP_ID_AUTOPILOT1,
            ATTITUDE_IGNORED, _NO_ATTITUDE, roll, pitch, yaw, thrust))

    def send_vision(
        self, stamp: float, position: np.ndarray, quaternion: np.ndarray,
        position_deviation: float, attitude_deviation: float,
    ) -> None:
        """Send a mocap pose: stamp [s], position (3,) [m, ENU], quaternion FLU → ENU."""
        self._send(vision_message(
            stamp, position, quaternion, position_deviation, attitude_deviation))

    def close(self) -> None:
        """Close the transport."""
        self._transport.close()

    def _send(self, message: Message) -> None:
        self._transport.send(self._codec.encode(message))

    def _handle(self, time: float, m: Message) -> None:
        kind = m.get_type()
        if kind == "HEARTBEAT":
            if m.autopilot != mavlink2.MAV_AUTOPILOT_INVALID:
                self._heard = time
                self._take_state(time, Mode.from_custom_mode(m.custom_mode),
                                 bool(m.base_mode & mavlink2.MAV_MODE_FLAG_SAFETY_ARMED))
        elif kind == "COMMAND_ACK":
            self._acknowledged(time, m.command, m.result)
        elif kind == "EXTENDED_SYS_STATE":
            self.landed = m.landed_state == mavlink2.MAV_LANDED_STATE_ON_GROUND
        elif kind == "STATUSTEXT":
            text = self._texts.add(m)
            if text is not None:
                self.sequence.text(m.severity, text)
        elif kind == "PARAM_VALUE":
            name = clean_text(m.param_id)
            if name in WATCHED:  # of others there may be any number
                self.values[name] = m.param_value
                self.warnings = tuple(differences(self._mapping, self.values))
        elif kind == "TIMESYNC" and m.tc1 == 0:
            self._send(mavlink2.MAVLink_timesync_message(round(time * 1e9), m.ts1))

    def _take_state(self, time: float, mode: Mode, armed: bool) -> None:
        if armed and not self.armed:
            self.armed_since = time
        elif not armed:
            self.armed_since = None
        self.mode, self.armed = mode, armed

    def _acknowledged(self, time: float, command: int, result: int) -> None:
        request = self._asked.pop(command, None)
        if request is None:
            return
        self.sequence.answer(request, result)
        if result != mavlink2.MAV_RESULT_ACCEPTED:
            return
        # the heartbeat that says so may be a second away
        mode = Mode.OFFBOARD if request is Request.OFFBOARD else self.mode
        armed = {Request.ARM: True, Request.DISARM: False}.get(request, self.armed)
        self._take_state(time, mode, armed)

    def _request(self, request: Request) -> None:
        if request is Request.OFFBOARD:
            main, sub = Mode.OFFBOARD.value
            self._command(Command.DO_SET_MODE, CUSTOM_MODE_ENABLED, main, sub)
            self._asked[Command.DO_SET_MODE] = request
        else:
            self._command(Command.ARM_DISARM, 1.0 if request is Request.ARM else 0.0)
            self._asked[Command.ARM_DISARM] = request

    def _command(self, command: int, *parameters: float) -> None:
        values = (*parameters, *[0.0] * (7 - len(parameters)))
        self._send(mavlink2.MAVLink_command_long_message(
            self._target, mavlink2.MAV_COMP_ID_AUTOPILOT1, command, 0, *values))

    def _ask_set_up(self, time: float) -> None:
        if not self._set_up:
            self._set_up = True
            for number, interval in INTERVALS.items():
                self._command(Command.SET_MESSAGE_INTERVAL, number, interval * 1e6)
        if time - self._parameters_asked < PARAMETER_RETRY:
            return
        missing = [name for name in WATCHED if name not in self.values]
        if missing and self._parameter_attempts < PARAMETER_ATTEMPTS:
            self._parameters_asked = time
            self._parameter_attempts += 1
            for name in missing:
                self._send(mavlink2.MAVLink_param_request_read_message(
                    self._target, mavlink2.MAV_COMP_ID_AUTOPILOT1, name.encode(), -1))
