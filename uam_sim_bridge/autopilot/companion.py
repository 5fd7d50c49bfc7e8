"""The autopilot's side of the link to a companion computer: messages in and out, no sockets."""

import math
import struct

import numpy as np

from uam_control.ages import age_by
from uam_control.maths.rotations import matrix_from_quaternion, quaternion_from_euler, rotate
from uam_control.offboard.modes import MavCmd, MavResult, Severity
from uam_control.setpoints.targets import AttitudeTarget, Target
from uam_control.settings.parameter_set import ParameterError
from uam_sim_bridge.autopilot.autopilot_estimator import GRAVITY
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.params import DEFINITIONS
from uam_sim_bridge.autopilot.telemetry import Telemetry
from uam_sim_bridge.mavlink.protocol.setpoint_messages import (
    GROUP,
    attitude_target,
    position_target,
    wrench_target,
)
from uam_sim_bridge.mavlink.protocol.wire import Message, clean_text, mavlink2, text_chunks

REPEAT = 5.0  # [s] from one text about a refused message to the next of the same wording
_PARAMETERS_PER_TICK = 10
_REAL, _INTEGER = mavlink2.MAV_PARAM_TYPE_REAL32, mavlink2.MAV_PARAM_TYPE_INT32
_POSE_FRAMES = (mavlink2.MAV_FRAME_LOCAL_NED, mavlink2.MAV_FRAME_LOCAL_FRD)


class Companion:
    """Handles the messages of a companion computer; `out`: answers not yet sent."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._system = int(autopilot.parameters["MAV_SYS_ID"])
        self.telemetry = Telemetry(autopilot)
        self.out: list[Message] = []
        self._listing: list[str] = []
        self._texts = 0
        self._said: dict[str, float] = {}  # text → time [s] of the last one
        self._handlers = {
            "SET_ATTITUDE_TARGET": self._attitude_target,
            "SET_POSITION_TARGET_LOCAL_NED": self._position_target,
            "SET_ACTUATOR_CONTROL_TARGET": self._wrench_target,
            "VISION_POSITION_ESTIMATE": self._vision_position,
            "ODOMETRY": self._odometry,
            "COMMAND_LONG": self._command_long,
            "COMMAND_INT": self._command_int,
            "SET_MODE": self._set_mode,
            "PARAM_REQUEST_READ": self._parameter_read,
            "PARAM_REQUEST_LIST": self._parameter_list,
            "PARAM_SET": self._parameter_set,
            "TIMESYNC": self._timesync,
            "MANUAL_CONTROL": self._manual_control,
            "RC_CHANNELS_OVERRIDE": self._radio,
        }

    def handle(self, time: float, message: Message) -> None:
        """Handle a message that arrived at `time` [s]; other types and targets are ignored."""
        handler = self._handlers.get(message.get_type())
        if handler is None or getattr(message, "target_system", 0) not in (0, self._system):
            return
        handler(time, message)

    def tick(self, time: float) -> list[Message]:
        """Return the messages to send at `time` [s]: answers, texts, parameters, telemetry."""
        for severity, text in self._autopilot.commander.take_texts():
            self._texts += 1
            self.out += text_chunks(severity, text, self._texts)
        for name in self._listing[:_PARAMETERS_PER_TICK]:
            self._send_parameter(name)
        del self._listing[:_PARAMETERS_PER_TICK]
        self.out += self.telemetry.due(time)
        out, self.out = self.out, []
        return out

    def _refuse(self, time: float, m: Message, reason: str) -> None:
        """Say which message was refused and why, again only after REPEAT."""
        text = f"{m.get_type()} refused: {reason}"
        if time - self._said.get(text, -math.inf) >= REPEAT:
            self._said[text] = time
            self._autopilot.commander.texts.append((Severity.WARNING, text))

    def _attitude_target(self, time: float, m: Message) -> None:
        self._target(time, m, attitude_target(m))

    def _position_target(self, time: float, m: Message) -> None:
        local = m.coordinate_frame == mavlink2.MAV_FRAME_LOCAL_NED
        wrong = "" if local else f"frame {m.coordinate_frame}, local NED expected"
        self._target(time, m, position_target(m), wrong)

    def _wrench_target(self, time: float, m: Message) -> None:
        wrong = "" if m.group_mlx == GROUP else f"group {m.group_mlx}, {GROUP} expected"
        self._target(time, m, wrench_target(m), wrong)

    def _target(self, time: float, m: Message, target: Target, wrong: str = "") -> None:
        """Pass a setpoint of the message `m` on; wrong: why not, "" for nothing."""
        if refused := wrong or self._autopilot.target(time, target):
            self._refuse(time, m, refused)

    def _vision_position(self, time: float, m: Message) -> None:
        euler = np.array([m.roll, m.pitch, m.yaw])
        position = np.array([m.x, m.y, m.z])
        if np.all(np.isfinite(euler)):
            age = age_by(1e-6 * m.usec, time)
            self._autopilot.vision(time, position, quaternion_from_euler(euler), age)

    def _odometry(self, time: float, m: Message) -> None:
        position, quaternion = np.array([m.x, m.y, m.z]), np.array(m.q, dtype=float)
        if m.frame_id not in _POSE_FRAMES:
            self._refuse(time, m, f"frame {m.frame_id}, local NED or FRD expected")
        else:
            self._autopilot.vision(time, position, quaternion, age_by(1e-6 * m.time_usec, time))

    def _command_long(self, time: float, m: Message) -> None:
        parameters = (m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7)
        self._run(time, m, parameters)

    def _command_int(self, time: float, m: Message) -> None:
        parameters = (m.param1, m.param2, m.param3, m.param4, float(m.x), float(m.y), m.z)
        self._run(time, m, parameters)

    def _run(self, time: float, m: Message, parameters: tuple[float, ...]) -> None:
        first, second = parameters[0], parameters[1]
        number = int(first) if math.isfinite(first) else -1
        if m.command == MavCmd.SET_MESSAGE_INTERVAL:
            known = self.telemetry.set_interval(number, second)
            result = MavResult.ACCEPTED if known else MavResult.DENIED
        elif m.command == MavCmd.REQUEST_MESSAGE:
            message = self.telemetry.build(number, time)
            result = MavResult.UNSUPPORTED if message is None else MavResult.ACCEPTED
            if message is not None:
                self.out.append(message)
        else:
            result = self._autopilot.command(time, m.command, parameters)
        self.out.append(
            mavlink2.MAVLink_command_ack_message(
                m.command, result, 0, 0, m.get_srcSystem(), m.get_srcComponent()
            )
        )

    def _set_mode(self, time: float, m: Message) -> None:
        spoken = self._autopilot.firmware
        _, *mode = spoken.mode_request(spoken.mode(m.custom_mode))
        given = *map(float, (m.base_mode, *mode)), 0, 0, 0, 0
        self._autopilot.command(time, MavCmd.DO_SET_MODE, given)

    def _parameter_read(self, time: float, m: Message) -> None:
        names = self._autopilot.parameters.names
        if 0 <= m.param_index < len(names):
            self._send_parameter(names[m.param_index])
        elif clean_text(m.param_id) in DEFINITIONS:
            self._send_parameter(clean_text(m.param_id))

    def _parameter_list(self, time: float, m: Message) -> None:
        self._listing = list(self._autopilot.parameters.names)

    def _parameter_set(self, time: float, m: Message) -> None:
        name = clean_text(m.param_id)
        definition = DEFINITIONS.get(name)
        value = m.param_value
        if definition is not None and definition.integer:
            # PX4 sends integers as the bytes of an int32 in the float's place
            value = struct.unpack("<i", struct.pack("<f", value))[0]
        try:
            self._autopilot.set_parameter(name, value)
        except (ParameterError, ValueError) as error:
            self._autopilot.commander.texts.append((Severity.WARNING, str(error)))
        if definition is not None:
            self._send_parameter(name)

    def _send_parameter(self, name: str) -> None:
        parameters, definition = self._autopilot.parameters, DEFINITIONS[name]
        value, kind = parameters[name], _REAL
        if definition.integer:
            value, kind = struct.unpack("<f", struct.pack("<i", int(value)))[0], _INTEGER
        self.out.append(
            mavlink2.MAVLink_param_value_message(
                name.encode(), value, kind, len(parameters.names), parameters.names.index(name)
            )
        )

    def _manual_control(self, time: float, m: Message) -> None:
        if m.target == self._system:
            right, up = 1e-3 * m.y, 2e-3 * m.z - 1.0  # z: 0..1000, as PX4 reads it
            sticks = 1e-3 * m.x, right, up, 1e-3 * m.r
            if all(abs(stick) <= 1.0 for stick in sticks):  # others: not available, or not valid
                self._autopilot.manual(time, sticks)

    def _radio(self, time: float, m: Message) -> None:
        """The channels of the pilot's radio, 1000 to 2000 µs: of them the kill switch alone."""
        parameters = self._autopilot.parameters
        channel = int(parameters["RC_MAP_KILL_SW"])
        if channel:
            share = (getattr(m, f"chan{channel}_raw") - 1000) / 1000.0
            self._autopilot.kill_switch(share > parameters["RC_KILLSWITCH_TH"])

    def _timesync(self, time: float, m: Message) -> None:
        if m.tc1 == 0:
            self.out.append(mavlink2.MAVLink_timesync_message(round(time * 1e9), m.ts1))


def warm_up() -> None:
    """Compile the functions of a flight, so that no tick waits for the compiler."""
    autopilot = Autopilot()
    companion = Companion(autopilot)
    zero, down, level = np.zeros(3), np.array([0.0, 0.0, -GRAVITY]), np.array([1.0, 0.0, 0.0, 0.0])
    targets = AttitudeTarget.of_rates(zero, 0.5), AttitudeTarget.of_attitude(level, 0.5)
    for k in range(300):
        time = 0.004 * k
        autopilot.vision(time, zero, level)
        autopilot.target(time, targets[k % 2])
        companion.tick(time)
        if k == 200:
            autopilot.command(time, MavCmd.DO_SET_MODE, (1.0, 6.0, 0.0))
            autopilot.command(time, MavCmd.ARM_DISARM, (1.0, 0.0))
        autopilot.update(time, zero, down)
    rotate(matrix_from_quaternion(quaternion_from_euler(zero)), zero)
    autopilot.command(time, MavCmd.DO_SET_MODE, (1.0, 4.0, 6.0))
    autopilot.update(time + 0.004, zero, down)
