"""Telemetry of the autopilot: message streams at their intervals, on sensor time."""

import math
from collections.abc import Callable

from uam_control.maths.rotations import matrix_from_quaternion, rotate_back
from uam_sim_bridge.autopilot.autopilot_estimator import ATTITUDE, POSITION, VELOCITY
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.mavlink.protocol.wire import Message, mavlink2

_NAN = float("nan")
_NO_COVARIANCE = [_NAN] * 21
_LANDED, _IN_AIR, _LANDING = 1, 2, 4  # MAV_LANDED_STATE
_STANDBY, _ACTIVE, _CRITICAL, _TERMINATED = 3, 4, 5, 8  # MAV_STATE
_GYRO, _ACCELEROMETER, _VISION = 1, 2, 128  # MAV_SYS_STATUS_SENSOR
_RADIO = mavlink2.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
_NO_VOLTAGE, _NO_TEMPERATURE = 65535, 32767  # MAVLink's values for "unknown"
_AIDED = (
    mavlink2.ESTIMATOR_VELOCITY_HORIZ
    | mavlink2.ESTIMATOR_VELOCITY_VERT
    | mavlink2.ESTIMATOR_POS_HORIZ_REL
    | mavlink2.ESTIMATOR_POS_VERT_ABS
    | mavlink2.ESTIMATOR_PRED_POS_HORIZ_REL
)
_IMU_FIELDS = 0x3F  # HIGHRES_IMU.fields_updated: accelerometer and gyroscope
TICK = 0.004  # s, shortest interval
FASTEST = {mavlink2.MAVLINK_MSG_ID_CURRENT_MODE: 0.5}  # [s] of it, besides each change (PX4)


def heartbeat(autopilot: Autopilot, time: float) -> Message:
    status = autopilot.status
    state = _CRITICAL if status.failsafe else _ACTIVE if status.armed else _STANDBY
    state = _TERMINATED if status.killed else state
    armed = mavlink2.MAV_MODE_FLAG_SAFETY_ARMED if status.armed else 0
    return mavlink2.MAVLink_heartbeat_message(
        mavlink2.MAV_TYPE_QUADROTOR,
        autopilot.firmware.autopilot,
        mavlink2.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | armed,
        autopilot.firmware.custom_mode(status.mode),
        state,
        3,
    )


def current_mode(autopilot: Autopilot, time: float) -> Message:
    """CURRENT_MODE: the mode that is flown, and the one that was chosen."""
    modes = autopilot.status.mode, autopilot.status.intended
    return mavlink2.MAVLink_current_mode_message(0, *map(autopilot.firmware.custom_mode, modes))


def sys_status(autopilot: Autopilot, time: float) -> Message:
    """SYS_STATUS: sensors, radio and their health; nothing of the battery."""
    own = _GYRO | _ACCELEROMETER | _RADIO
    there = own | _VISION
    healthy = there if autopilot.estimator.aided(time) else own
    return mavlink2.MAVLink_sys_status_message(
        there, there, healthy, 0, _NO_VOLTAGE, -1, -1, 0, 0, 0, 0, 0, 0
    )


def extended_sys_state(autopilot: Autopilot, time: float) -> Message:
    """EXTENDED_SYS_STATE: on the ground or in the air."""
    status = autopilot.status
    state = _LANDED if status.landed else _LANDING if status.failsafe else _IN_AIR
    return mavlink2.MAVLink_extended_sys_state_message(0, state)


def attitude_quaternion(autopilot: Autopilot, time: float) -> Message:
    """ATTITUDE_QUATERNION: quaternion FRD → NED, body rates FRD [rad/s]."""
    q, rates = autopilot.estimator.estimate[ATTITUDE].tolist(), autopilot.rates.tolist()
    return mavlink2.MAVLink_attitude_quaternion_message(_milliseconds(time), *q, *rates)


def odometry(autopilot: Autopilot, time: float) -> Message:
    """ODOMETRY: pose [m] in local NED, velocity [m/s] and rates [rad/s] in body FRD."""
    estimate = autopilot.estimator.estimate
    velocity = rotate_back(matrix_from_quaternion(estimate[ATTITUDE]), estimate[VELOCITY])
    return mavlink2.MAVLink_odometry_message(
        round(time * 1e6),
        mavlink2.MAV_FRAME_LOCAL_NED,
        mavlink2.MAV_FRAME_BODY_FRD,
        *estimate[POSITION].tolist(),
        estimate[ATTITUDE].tolist(),
        *velocity.tolist(),
        *autopilot.rates.tolist(),
        _NO_COVARIANCE,
        _NO_COVARIANCE,
    )


def highres_imu(autopilot: Autopilot, time: float) -> Message:
    """HIGHRES_IMU: the newest sample, FRD; the fields of other sensors are empty."""
    gyro, force = autopilot.imu
    return mavlink2.MAVLink_highres_imu_message(
        round(time * 1e6), *force.tolist(), *gyro.tolist(), *[0.0] * 7, _IMU_FIELDS
    )


def battery_status(autopilot: Autopilot, time: float) -> Message:
    """BATTERY_STATUS: charge and charge state with SIM_BAT_ENABLE; all else is unknown."""
    charge = autopilot.battery.charge
    return mavlink2.MAVLink_battery_status_message(
        0,
        mavlink2.MAV_BATTERY_FUNCTION_ALL,
        mavlink2.MAV_BATTERY_TYPE_LIPO,
        _NO_TEMPERATURE,
        [_NO_VOLTAGE] * 10,
        -1,
        -1,
        -1,
        -1 if charge is None else round(100.0 * charge),
        0,
        autopilot.battery.state,
    )


def estimator_status(autopilot: Autopilot, time: float) -> Message:
    """ESTIMATOR_STATUS: positions and velocities with vision, constant-position mode without."""
    flags = mavlink2.ESTIMATOR_ATTITUDE
    flags |= _AIDED if autopilot.estimator.aided(time) else mavlink2.ESTIMATOR_CONST_POS_MODE
    return mavlink2.MAVLink_estimator_status_message(round(time * 1e6), flags, *[_NAN] * 8)


def timesync(autopilot: Autopilot, time: float) -> Message:
    return mavlink2.MAVLink_timesync_message(0, round(time * 1e9))


def _milliseconds(time: float) -> int:
    return round(time * 1e3) & 0xFFFFFFFF


# message id → (builder, default interval [s]); PX4's onboard link, 0 for off
STREAMS: dict[int, tuple[Callable[[Autopilot, float], Message], float]] = {
    mavlink2.MAVLINK_MSG_ID_HEARTBEAT: (heartbeat, 1.0),
    mavlink2.MAVLINK_MSG_ID_CURRENT_MODE: (current_mode, 2.0),
    mavlink2.MAVLINK_MSG_ID_SYS_STATUS: (sys_status, 0.2),
    mavlink2.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: (extended_sys_state, 0.2),
    mavlink2.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: (attitude_quaternion, 0.02),
    mavlink2.MAVLINK_MSG_ID_ODOMETRY: (odometry, 1.0 / 30.0),
    mavlink2.MAVLINK_MSG_ID_HIGHRES_IMU: (highres_imu, 0.0),  # only on request
    mavlink2.MAVLINK_MSG_ID_BATTERY_STATUS: (battery_status, 2.0),
    mavlink2.MAVLINK_MSG_ID_ESTIMATOR_STATUS: (estimator_status, 1.0),
    mavlink2.MAVLINK_MSG_ID_TIMESYNC: (timesync, 0.1),
}


class Telemetry:
    """The streams with their intervals and next due times."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._intervals = {number: interval for number, (_, interval) in STREAMS.items()}
        self._due = dict.fromkeys(STREAMS, -math.inf)
        self._told = autopilot.status

    def set_interval(self, number: int, microseconds: float) -> bool:
        """Handle SET_MESSAGE_INTERVAL: -1 off, 0 default; False if the stream does not exist."""
        if number not in STREAMS or not math.isfinite(microseconds):
            return False
        if microseconds < 0.0:
            self._intervals[number] = 0.0
        elif microseconds == 0.0:
            self._intervals[number] = STREAMS[number][1]
        else:
            self._intervals[number] = max(FASTEST.get(number, TICK), microseconds * 1e-6)
        self._due[number] = -math.inf
        return True

    def build(self, number: int, time: float) -> Message | None:
        """Return one message of a stream, None if the stream does not exist."""
        return STREAMS[number][0](self._autopilot, time) if number in STREAMS else None

    def due(self, time: float) -> list[Message]:
        """Return the messages due at `time` [s]; a change of state makes HEARTBEAT due at once."""
        if self._told != self._autopilot.status:
            self._told = self._autopilot.status
            self._due[mavlink2.MAVLINK_MSG_ID_HEARTBEAT] = -math.inf
            self._due[mavlink2.MAVLINK_MSG_ID_EXTENDED_SYS_STATE] = -math.inf
            self._due[mavlink2.MAVLINK_MSG_ID_CURRENT_MODE] = -math.inf
        messages = []
        for number, due in self._due.items():
            interval = self._intervals[number]
            if interval <= 0.0 or time < due - 1e-9:
                continue
            following = due + interval
            self._due[number] = following if following > time else time + interval
            messages.append(STREAMS[number][0](self._autopilot, time))
        return messages
