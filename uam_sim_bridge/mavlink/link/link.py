"""The bridge's side of the link to the autopilot: heartbeats, commands, texts, parameters, time.

`OffboardLink` works on any `Transport`. All times are times of control ticks; there are no timers
on wall time. TIMESYNC alone may have another clock: where the autopilot's IMU starts the ticks,
their times follow from TIMESYNC.
"""

import math
from collections.abc import Callable

from uam_control.ages import DISCONNECTED
from uam_control.offboard.autopilot_magnet import AutopilotMagnet
from uam_control.offboard.exchange import Request
from uam_control.offboard.modes import MavCmd, MavResult, Severity
from uam_control.offboard.sequence import LINK_GAP, OffboardSequence
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_control.setpoints.targets import Target, VisionPose
from uam_sim_bridge.mavlink.link.flight_state import FlightState
from uam_sim_bridge.mavlink.protocol.setpoint_messages import setpoint_message, vision_message
from uam_sim_bridge.mavlink.protocol.wire import (
    Codec,
    Framer,
    Message,
    Signing,
    TextAssembler,
    mavlink2,
)
from uam_sim_bridge.mavlink.telemetry.events import EventReader
from uam_sim_bridge.mavlink.telemetry.parameter_check import ParameterWatch
from uam_sim_bridge.mavlink.telemetry.parameter_check import request as parameter_request
from uam_sim_bridge.mavlink.telemetry.parameter_check import setting as parameter_setting
from uam_sim_bridge.mavlink.telemetry.required_parameters import RequiredParameters
from uam_sim_bridge.mavlink.telemetry.streams import LinkStatistics, StreamCheck
from uam_sim_bridge.mavlink.telemetry.time_sync import (
    HIGHRES_IMU,
    AutopilotImu,
    RebootDetector,
    TimeSync,
    nanoseconds,
)
from uam_sim_bridge.mavlink.telemetry.vitals import ESTIMATOR_FLAGS, Vitals, estimate_faults, names
from uam_sim_bridge.mavlink.transport.transport import Transport

HEARTBEAT_PERIOD = 1.0  # s
LOSS_TIME = 1.0  # s, PX4's COM_OF_LOSS_T until it has been read
UNSIGNED = (
    "the autopilot does not sign its messages, and signing_key is set: all are refused. PX4 has "
    "MAVLink signing from v1.18 on, with a key: start without signing_key, on a link that nobody "
    "else reaches"
)
# other components of the vehicle, as a gimbal, send these, too, with other meaning
OF_AUTOPILOT = {
    *("HEARTBEAT", "CURRENT_MODE", "EXTENDED_SYS_STATE", "COMMAND_ACK"),
    *("TIMESYNC", "ATTITUDE_QUATERNION"),
}
EXPLAIN_PERIOD = 3.0  # s between two requests for the failed arming checks


class OffboardLink(FlightState):
    """State of the autopilot from its messages, and the messages to it; see `FlightState`.

    `ignored`: number of messages from other systems or for other receivers; `reboots`: number of
    restarts.
    """

    def __init__(
        self,
        transport: Transport,
        sequence: OffboardSequence,
        mapping: RateThrustParameters,
        target_system: int = 1,
        signing: Signing | None = None,
        imu_rate: float = 0.0,
        clock: Callable[[], float] | None = None,
        required: RequiredParameters | None = None,
    ) -> None:
        """imu_rate [Hz]: of the autopilot's IMU, 0: not requested; clock: the companion's [s], to
        which stamps of that IMU are converted, None: the times of the ticks; required: parameters
        to compare."""
        super().__init__()
        self._clock = clock
        self.sequence = sequence
        self.ignored = self.reboots = 0
        self.foreign: set[int] = set()  # system ids of other autopilots whose heartbeats have come
        self.vitals = Vitals()  # battery, estimator and sensors
        self.time_sync = TimeSync()
        self.imu = AutopilotImu(self.time_sync) if imu_rate else None
        self.magnet: AutopilotMagnet | None = None  # on one of its outputs, if the owner sets it
        self.streams = StreamCheck({HIGHRES_IMU: imu_rate} if imu_rate else None)
        self.statistics = LinkStatistics()
        self._reboot = RebootDetector()
        self._firmware = spoken = sequence.firmware
        self._events = EventReader(spoken)
        self.parameters = ParameterWatch(mapping, required, spoken)  # watched and required ones
        self.transport = transport
        self._target = target_system
        self.codec = Codec(target_system, mavlink2.MAV_COMP_ID_ONBOARD_COMPUTER, signing)
        self.framer = Framer(self.codec)
        self._texts = TextAssembler()
        self._pending: dict[int, Request] = {}
        self._heartbeat_in = self._heartbeat_out = self._explained = -math.inf
        self.heard = -math.inf
        self.alive = False  # connected at the last `maintain`
        self._told_unsigned = False

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return one line per problem with the autopilot's parameters and streams."""
        unsigned = (UNSIGNED,) if self._unsigned else ()
        foreign = (self._foreign,) if self.foreign and not self.alive else ()
        return unsigned + foreign + self.parameters.warnings + self.streams.warnings

    @property
    def _foreign(self) -> str:
        there = ", ".join(map(str, sorted(self.foreign)))
        return (
            f"no heartbeat of system {self._target}, but of system {there}: set autopilot_system, "
            "or the autopilot's MAV_SYS_ID"
        )

    @property
    def _unsigned(self) -> bool:
        """Whether the autopilot sends only unsigned messages, which this link refuses."""
        return self.codec.unsigned is not None and self._heartbeat_in == -math.inf

    @property
    def lost(self) -> int:
        """Return the number of lost messages, from gaps in the sequence numbers."""
        return self.statistics.lost(self.framer.unread)

    @property
    def loss_time(self) -> float:
        """For how long [s] the autopilot stays in OFFBOARD without setpoints; at least LINK_GAP."""
        return max(LINK_GAP, self.parameters.values.get(self._firmware.loss_time, LOSS_TIME))

    @property
    def round_trip(self) -> float | None:
        """How long answers take [s], the quickest of the last second; None while not known."""
        return self.time_sync.quickest

    def connected(self, time: float) -> bool:
        """Return whether a heartbeat arrived in the last DISCONNECTED before `time` [s]."""
        return time - self._heartbeat_in < DISCONNECTED

    def poll(self, time: float) -> None:
        """Process all received messages at the tick `time` [s]."""
        for data in self.transport.receive():
            for message in self.framer.take(data, self.transport.stream):
                if message.get_srcSystem() != self._target or not self._for_us(message):
                    self.ignored += 1
                    self._note_foreign(message)
                else:
                    self.statistics.count(message.get_srcComponent(), message.get_seq())
                    self.streams.count(message.get_msgId(), time)
                    self.heard = time
                    self._handle(time, message)
        self.statistics.tick(time)

    def maintain(self, time: float) -> bool:
        """Send heartbeat and telemetry requests due at `time` [s]; return `connected`."""
        if time - self._heartbeat_out >= HEARTBEAT_PERIOD - 1e-9:
            self._heartbeat_out = time
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
        if connected and not self.alive:
            self._restart_requests()
        self.alive = connected
        if connected:
            self._request_telemetry(time)
        return connected

    def tick(self, time: float) -> None:
        """Send what `maintain` sends, and mode and arming requests due at `time` [s]."""
        if self._unsigned and not self._told_unsigned:
            self._told_unsigned = True
            self.sequence.text(Severity.ERROR, UNSIGNED)
        connected = self.maintain(time)
        self.settle(time)
        seen = self.reported(connected, self.time_sync.delivered)
        request = self.sequence.update(time, seen)
        if request is not None:
            self._request(request)
        if connected:
            self.send_magnet(time)

    def send_magnet(self, time: float) -> None:
        """Send the command of the magnet that is due at `time` [s]."""
        due = None if self.magnet is None else self.magnet.due(time)
        if due is not None:
            command, parameters = due
            self._command(command, *parameters)

    def kill(self) -> None:
        """Request at once that the motors stop; the ticks repeat it while the vehicle is armed."""
        self.sequence.kill()
        self._request(Request.KILL)

    def send_setpoint(self, target: Target, time: float) -> None:
        """Send the setpoint of the tick `time` [s]: SET_ATTITUDE_TARGET,
        SET_POSITION_TARGET_LOCAL_NED or SET_ACTUATOR_CONTROL_TARGET.

        Raises ValueError if a value is not finite or thrust is out of range.
        """
        if target.refused() or target.thrust < 0.0 or target.thrust > 1.0:
            raise ValueError(f"setpoint {target}; finite values and thrust 0..1 allowed")
        self._send(setpoint_message(target, time, self._target))

    def send_vision(self, pose: VisionPose) -> None:
        self._send(vision_message(pose))

    def close(self) -> None:
        self.transport.close()

    def values(self) -> dict[str, str | int | None]:
        """Return the values for /diagnostics; None before the first message with the value."""
        vitals, sync = self.vitals, self.time_sync
        flags, battery = vitals.estimator_flags, vitals.battery
        return {
            "round trip [ms]": _scaled(sync.round_trip, 1e3, ".1f"),
            "clock offset [ms]": _scaled(sync.offset, 1e3, ".1f"),
            "messages [1/s]": f"{self.statistics.rate:.0f}",
            "messages lost": self.lost,
            "bad bytes": self.framer.bad_bytes,
            "reboots of the autopilot": self.reboots,
            "estimator": None if flags is None else ", ".join(names(flags, ESTIMATOR_FLAGS)),
            "sensors unhealthy": ", ".join(vitals.unhealthy),
            "autopilot load [%]": _scaled(vitals.load, 100.0, ".0f"),
            "battery [V]": f"{battery.voltage:.2f}" if battery and battery.known else None,
        }

    def faults(self) -> tuple[str, ...]:
        """Return one text per fault of the autopilot's estimate; () while it is disarmed."""
        flags = self.vitals.estimator_flags
        if not self.armed or flags is None:
            return ()
        return tuple(f"autopilot: {fault}" for fault in estimate_faults(flags))

    def _note_foreign(self, m: Message) -> None:
        if m.get_type() == "HEARTBEAT" and m.autopilot != mavlink2.MAV_AUTOPILOT_INVALID:
            self.foreign.add(m.get_srcSystem())

    def _for_us(self, m: Message) -> bool:
        """Return whether the message is a broadcast or addressed to this companion computer."""
        return getattr(m, "target_system", 0) in (0, self._target) and getattr(
            m, "target_component", 0
        ) in (0, mavlink2.MAV_COMP_ID_ONBOARD_COMPUTER)

    def _send(self, message: Message) -> None:
        self.transport.send(self.codec.encode(message))

    def _handle(self, time: float, m: Message) -> None:
        kind = m.get_type()
        if kind in OF_AUTOPILOT and m.get_srcComponent() != mavlink2.MAV_COMP_ID_AUTOPILOT1:
            self.ignored += 1
            return
        self._watch_clock(time, kind, m)
        if kind == "HEARTBEAT":
            if m.autopilot != mavlink2.MAV_AUTOPILOT_INVALID:
                self._heartbeat_in = time
                self.failsafe = m.system_status == mavlink2.MAV_STATE_CRITICAL
                self.killed = m.system_status == mavlink2.MAV_STATE_FLIGHT_TERMINATION
                self.take_heartbeat(
                    time,
                    self._firmware.mode(m.custom_mode),
                    bool(m.base_mode & mavlink2.MAV_MODE_FLAG_SAFETY_ARMED),
                )
        elif kind == "CURRENT_MODE":
            modes = map(self._firmware.mode, (m.custom_mode, m.intended_custom_mode))
            self.take_current_mode(time, *modes, self.landed)
        elif kind == "COMMAND_ACK":
            self._acknowledged(time, m.command, m.result)
        elif kind == "EXTENDED_SYS_STATE":
            self.landed = m.landed_state == mavlink2.MAV_LANDED_STATE_ON_GROUND
        elif kind == "STATUSTEXT":
            text = self._texts.add(m)
            if text is not None:
                self.sequence.text(m.severity, text)
        elif kind == "EVENT":
            event = self._events.read(m)
            if event is not None:
                self.sequence.text(*event)
        elif kind == "PARAM_VALUE":
            self.parameters.take(m)
        elif kind == "TIMESYNC" and m.tc1 == 0:
            now = nanoseconds(self._synchronised(time))
            self._send(mavlink2.MAVLink_timesync_message(now, m.ts1))
        elif kind == "HIGHRES_IMU" and self.imu is not None:
            self.imu.take(m)
        else:
            self.vitals.take(kind, m)

    def _synchronised(self, time: float) -> float:
        """Return the time [s] of the clock that TIMESYNC relates; time: of the tick."""
        return time if self._clock is None else self._clock()

    def _watch_clock(self, time: float, kind: str, m: Message) -> None:
        """Pass the autopilot's time to the reboot detection and the time synchronisation."""
        if kind == "TIMESYNC":
            since_boot = (m.tc1 or m.ts1) * 1e-9
        elif kind == "ATTITUDE_QUATERNION":
            since_boot = m.time_boot_ms * 1e-3
        else:
            return
        if kind == "TIMESYNC" and m.tc1 != 0:
            self.time_sync.answer(self._synchronised(time), m.tc1, m.ts1)
        if self._reboot.time_since_boot(since_boot):
            self.reboots += 1
            self.time_sync.restart()
            self._restart_requests()
            self.sequence.rebooted(time)

    def _restart_requests(self) -> None:
        """Request streams and parameters again: the autopilot has connected or rebooted."""
        self.statistics.restart()
        if self.magnet is not None:
            self.magnet.restart()
        self.streams.restart()
        self._pending.clear()
        self.parameters.restart()

    def _acknowledged(self, time: float, command: int, result: int) -> None:
        if command == MavCmd.SET_MESSAGE_INTERVAL:
            self.streams.answer(result)
            return
        if self.magnet is not None and self.magnet.answer(time, command, result):
            return
        request = self._pending.pop(command, None)
        if request is None:
            return
        self.sequence.answer(request, result)
        if result != MavResult.ACCEPTED:
            # PX4 reports a failed check once, when it begins to fail; that may be before connection
            if request is Request.ARM and time - self._explained >= EXPLAIN_PERIOD:
                self._explained = time
                self._command(MavCmd.RUN_PREARM_CHECKS)
            return
        self.take_accepted(time, request)

    def _request(self, request: Request) -> None:
        command, parameters = self.sequence.commands[request]
        self._command(command, *parameters)
        self._pending[command] = request

    def _command(self, command: int, *parameters: float) -> None:
        values = (*parameters, *[0.0] * (7 - len(parameters)))
        self._send(
            mavlink2.MAVLink_command_long_message(
                self._target, mavlink2.MAV_COMP_ID_AUTOPILOT1, command, 0, *values
            )
        )

    def _request_telemetry(self, time: float) -> None:
        ts1 = self.time_sync.request(self._synchronised(time))
        if ts1 is not None:
            self._send(mavlink2.MAVLink_timesync_message(0, ts1))
        stream = self.streams.request(time)
        if stream is not None:
            self._command(MavCmd.SET_MESSAGE_INTERVAL, *stream)
        for name in self.parameters.due(time):
            self._send(parameter_request(name, self._target))
        for name, value, kind in () if self.armed else self.parameters.to_write(time):
            as_bytes = self._firmware.integers_as_bytes
            self._send(parameter_setting(name, value, kind, self._target, as_bytes))


def _scaled(value: float | None, scale: float, form: str) -> str | None:
    return None if value is None else format(scale * value, form)
