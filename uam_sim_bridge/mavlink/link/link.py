"""The bridge's side of the link to the autopilot: heartbeats, commands, texts, parameters, time.

Protocol and transport are apart: `OffboardLink` works on any `Transport`. All times are those of
the control ticks; there are no wall timers.
"""

from __future__ import annotations

import math

import numpy as np

from uam_sim_bridge.mavlink.link.vision import vision_message
from uam_sim_bridge.mavlink.offboard.sequence import HEARTBEAT_TIMEOUT, OffboardSequence, Request
from uam_sim_bridge.mavlink.offboard.setpoint import RateThrustParameters
from uam_sim_bridge.mavlink.protocol.frames import swap_body
from uam_sim_bridge.mavlink.protocol.modes import CUSTOM_MODE_ENABLED, MavCmd, MavResult, Mode
from uam_sim_bridge.mavlink.protocol.signing import Signing
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, Message, TextAssembler, mavlink2
from uam_sim_bridge.mavlink.telemetry.events import EventReader
from uam_sim_bridge.mavlink.telemetry.link_statistics import LinkStatistics
from uam_sim_bridge.mavlink.telemetry.parameter_watch import ParameterWatch
from uam_sim_bridge.mavlink.telemetry.reboot import RebootDetector
from uam_sim_bridge.mavlink.telemetry.streams import StreamCheck
from uam_sim_bridge.mavlink.telemetry.time_sync import TimeSync, nanoseconds
from uam_sim_bridge.mavlink.telemetry.vitals import Vitals
from uam_sim_bridge.mavlink.transport.transport import Transport

HEARTBEAT_PERIOD = 1.0  # s
EXPLAIN_PERIOD = 3.0  # s between two requests to say again what keeps it from arming
_NO_ATTITUDE = [1.0, 0.0, 0.0, 0.0]
ATTITUDE_IGNORED = 128  # type_mask of SET_ATTITUDE_TARGET: body rates and thrust count


class OffboardLink:
    """The autopilot as the bridge sees it, and the way to it.

    `armed`, `mode`, `landed`: its latest word; `armed_since` [s] or None: tick at which it was
    first known armed; `values`: by name, those of its parameters that are WATCHED; `ignored`:
    messages of other systems, and answers to others; `vitals`: how it is; `reboots`: how often it
    has restarted.
    """

    def __init__(
        self,
        transport: Transport,
        sequence: OffboardSequence,
        mapping: RateThrustParameters,
        target_system: int = 1,
        signing: Signing | None = None,
    ) -> None:
        self.sequence = sequence
        self.mode, self.armed, self.landed = Mode.UNKNOWN, False, True
        self.armed_since: float | None = None
        self.ignored = self.reboots = 0
        self.vitals = Vitals()
        self.time_sync = TimeSync()
        self.streams = StreamCheck()
        self.statistics = LinkStatistics()
        self._reboot = RebootDetector()
        self._events = EventReader()
        self._parameters = ParameterWatch(mapping)
        self.values = self._parameters.values
        self._transport = transport
        self._target = target_system
        self._codec = Codec(target_system, mavlink2.MAV_COMP_ID_ONBOARD_COMPUTER, signing)
        self._framer = Framer(self._codec)
        self._texts = TextAssembler()
        self._asked: dict[int, Request] = {}
        self._heard = self._beat = self._explained = -math.inf
        self._met = False  # connected at the last tick

    def set_mapping(self, mapping: RateThrustParameters) -> None:
        """Compare the autopilot's parameters with another mapping from now on."""
        self._parameters.set_mapping(mapping)

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line for each thing about parameters and streams that is not as it should be."""
        return self._parameters.warnings + self.streams.warnings

    @property
    def mapping_read(self) -> bool:
        """Return whether every parameter that the mapping assumes has been received."""
        return self._parameters.mapping_read

    @property
    def bad_bytes(self) -> int:
        """Bytes that belonged to no message."""
        return self._framer.bad_bytes

    @property
    def lost(self) -> int:
        """Messages lost on their way to us, by gaps in their numbers."""
        return self.statistics.lost(self._framer.unread)

    @property
    def refused(self) -> int:
        """Messages refused for their signature."""
        return self._codec.refused

    @property
    def open(self) -> bool:
        """Whether the transport is open, as far as this end can tell."""
        return self._transport.connected

    @property
    def dropped(self) -> int:
        """Frames that the transport did not take."""
        return self._transport.dropped

    def connected(self, time: float) -> bool:
        """Whether a heartbeat came within the last seconds."""
        return time - self._heard < HEARTBEAT_TIMEOUT

    def poll(self, time: float) -> None:
        """Handle everything that has arrived, at the tick `time` [s]."""
        for data in self._transport.receive():
            for message in self._framer.take(data, self._transport.stream):
                if message.get_srcSystem() != self._target or not self._for_us(message):
                    self.ignored += 1
                else:
                    self.statistics.count(message.get_srcComponent(), message.get_seq())
                    self.streams.count(message.get_msgId())
                    self._handle(time, message)
        self.statistics.tick(time)

    def tick(self, time: float) -> None:
        """Send what is due besides setpoints: heartbeat, requests of the sequence, questions."""
        if time - self._beat >= HEARTBEAT_PERIOD - 1e-9:
            self._beat = time
            self._send(
                mavlink2.MAVLink_heartbeat_message(
                    mavlink2.MAV_TYPE_ONBOARD_CONTROLLER,
                    mavlink2.MAV_AUTOPILOT_INVALID,
                    0,
                    0,
                    mavlink2.MAV_STATE_ACTIVE,
                    3,
                )
            )
        connected = self.connected(time)
        if connected and not self._met:
            self._meet()
        self._met = connected
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
        self._send(
            mavlink2.MAVLink_set_attitude_target_message(
                round(time * 1e3) & 0xFFFFFFFF,
                self._target,
                mavlink2.MAV_COMP_ID_AUTOPILOT1,
                ATTITUDE_IGNORED,
                _NO_ATTITUDE,
                roll,
                pitch,
                yaw,
                thrust,
            )
        )

    def send_vision(
        self,
        stamp: float,
        position: np.ndarray,
        quaternion: np.ndarray,
        position_deviation: float,
        attitude_deviation: float,
    ) -> None:
        """Send a mocap pose: stamp [s], position (3,) [m, ENU], quaternion FLU → ENU."""
        self._send(
            vision_message(stamp, position, quaternion, position_deviation, attitude_deviation)
        )

    def close(self) -> None:
        """Close the transport."""
        self._transport.close()

    def _for_us(self, m: Message) -> bool:
        """Whether it is for everybody or for us: a ground station gets answers of its own."""
        return getattr(m, "target_system", 0) in (0, self._target) and getattr(
            m, "target_component", 0
        ) in (0, mavlink2.MAV_COMP_ID_ONBOARD_COMPUTER)

    def _send(self, message: Message) -> None:
        self._transport.send(self._codec.encode(message))

    def _handle(self, time: float, m: Message) -> None:
        kind = m.get_type()
        self._watch_clock(time, kind, m)
        if kind == "HEARTBEAT":
            if m.autopilot != mavlink2.MAV_AUTOPILOT_INVALID:
                self._heard = time
                self._take_state(
                    time,
                    Mode.from_custom_mode(m.custom_mode),
                    bool(m.base_mode & mavlink2.MAV_MODE_FLAG_SAFETY_ARMED),
                )
        elif kind == "COMMAND_ACK":
            self._acknowledged(time, m.command, m.result)
        elif kind == "EXTENDED_SYS_STATE":
            self.landed = m.landed_state == mavlink2.MAV_LANDED_STATE_ON_GROUND
        elif kind == "STATUSTEXT":
            text = self._texts.add(m)
            if text is not None:
                self.sequence.text(m.severity, text)
        elif kind == "EVENT":
            said = self._events.read(m)
            if said is not None:
                self.sequence.text(*said)
        elif kind == "PARAM_VALUE":
            self._parameters.take(m)
        elif kind == "TIMESYNC" and m.tc1 == 0:
            self._send(mavlink2.MAVLink_timesync_message(nanoseconds(time), m.ts1))
        else:
            self.vitals.take(kind, m)

    def _watch_clock(self, time: float, kind: str, m: Message) -> None:
        """Follow the autopilot's clock, and notice that it starts again."""
        if m.get_srcComponent() != mavlink2.MAV_COMP_ID_AUTOPILOT1:
            return
        if kind == "TIMESYNC":
            since_boot = (m.tc1 or m.ts1) * 1e-9
        elif kind == "ATTITUDE_QUATERNION":
            since_boot = m.time_boot_ms * 1e-3
        else:
            return
        restarted = self._reboot.time_since_boot(since_boot)
        if not restarted and kind == "TIMESYNC" and m.tc1 != 0:
            restarted = self.time_sync.answer(time, m.tc1, m.ts1)
        if restarted:
            self.reboots += 1
            self.time_sync.restart()
            self._meet()
            self.sequence.rebooted(time)

    def _meet(self) -> None:
        """Ask for everything anew: the autopilot is there for the first time, or again."""
        self.statistics.restart()
        self.streams.restart()
        self._asked.clear()
        self._parameters.restart()

    def _take_state(self, time: float, mode: Mode, armed: bool) -> None:
        if armed and not self.armed:
            self.armed_since = time
        elif not armed:
            self.armed_since = None
        self.mode, self.armed = mode, armed

    def _acknowledged(self, time: float, command: int, result: int) -> None:
        if command == MavCmd.SET_MESSAGE_INTERVAL:
            self.streams.answer(result)
            return
        request = self._asked.pop(command, None)
        if request is None:
            return
        self.sequence.answer(request, result)
        if result != MavResult.ACCEPTED:
            # PX4 tells a failed check once, when it begins to fail: that may have been before us
            if request is Request.ARM and time - self._explained >= EXPLAIN_PERIOD:
                self._explained = time
                self._command(MavCmd.RUN_PREARM_CHECKS)
            return
        # the heartbeat that says so may be a second away
        mode = Mode.OFFBOARD if request is Request.OFFBOARD else self.mode
        armed = {Request.ARM: True, Request.DISARM: False}.get(request, self.armed)
        self._take_state(time, mode, armed)

    def _request(self, request: Request) -> None:
        if request is Request.OFFBOARD:
            main, sub = Mode.OFFBOARD.value
            self._command(MavCmd.DO_SET_MODE, CUSTOM_MODE_ENABLED, main, sub)
            self._asked[MavCmd.DO_SET_MODE] = request
        else:
            self._command(MavCmd.ARM_DISARM, 1.0 if request is Request.ARM else 0.0)
            self._asked[MavCmd.ARM_DISARM] = request

    def _command(self, command: int, *parameters: float) -> None:
        values = (*parameters, *[0.0] * (7 - len(parameters)))
        self._send(
            mavlink2.MAVLink_command_long_message(
                self._target, mavlink2.MAV_COMP_ID_AUTOPILOT1, command, 0, *values
            )
        )

    def _ask_set_up(self, time: float) -> None:
        ts1 = self.time_sync.request(time)
        if ts1 is not None:
            self._send(mavlink2.MAVLink_timesync_message(0, ts1))
        wanted = self.streams.request(time)
        if wanted is not None:
            self._command(MavCmd.SET_MESSAGE_INTERVAL, *wanted)
        for name in self._parameters.due(time):
            self._send(
                mavlink2.MAVLink_param_request_read_message(
                    self._target, mavlink2.MAV_COMP_ID_AUTOPILOT1, name.encode(), -1
                )
            )
