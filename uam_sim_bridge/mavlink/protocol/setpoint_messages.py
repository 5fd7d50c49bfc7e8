"""Setpoints and motion-capture poses as MAVLink messages, and back."""

import numpy as np

from uam_control.frames import swap_euler, swap_world
from uam_control.maths.rotations import euler_from_quaternion
from uam_control.setpoints.targets import (
    ACCELERATION_IGNORED,
    VELOCITY_IGNORED,
    YAW_RATE_IGNORED,
    AttitudeTarget,
    PositionTarget,
    Target,
    VisionPose,
    WrenchTarget,
)
from uam_sim_bridge.mavlink.protocol.wire import Message, mavlink2

GROUP = 0  # of SET_ACTUATOR_CONTROL_TARGET: flight controls
# indices of the diagonal in the upper triangle of the 6x6 covariance, stored row by row
_DIAGONAL = (0, 6, 11, 15, 18, 20)


def setpoint_message(target: Target, time: float, system: int) -> Message:
    """Return the setpoint as a message to the autopilot of the system id `system`; time [s]."""
    milliseconds = round(time * 1e3) & 0xFFFFFFFF
    if isinstance(target, AttitudeTarget):
        return mavlink2.MAVLink_set_attitude_target_message(
            milliseconds,
            system,
            mavlink2.MAV_COMP_ID_AUTOPILOT1,
            target.type_mask,
            target.quaternion.tolist(),
            *target.rates.tolist(),
            target.thrust,
        )
    if isinstance(target, WrenchTarget):
        controls = [*target.torque.tolist(), target.thrust, *(0.0,) * 4]
        return mavlink2.MAVLink_set_actuator_control_target_message(
            milliseconds * 1000, GROUP, system, mavlink2.MAV_COMP_ID_AUTOPILOT1, controls
        )
    return mavlink2.MAVLink_set_position_target_local_ned_message(
        milliseconds,
        system,
        mavlink2.MAV_COMP_ID_AUTOPILOT1,
        mavlink2.MAV_FRAME_LOCAL_NED,
        target.type_mask,
        *target.position.tolist(),
        *target.velocity.tolist(),
        *target.acceleration.tolist(),
        target.yaw,
        target.yaw_rate,
    )


def attitude_target(m: Message) -> AttitudeTarget:
    """Return the content of a SET_ATTITUDE_TARGET."""
    rates = np.array([m.body_roll_rate, m.body_pitch_rate, m.body_yaw_rate])
    return AttitudeTarget(m.type_mask, np.array(m.q, dtype=float), rates, m.thrust)


def wrench_target(m: Message) -> WrenchTarget:
    """Return the content of a SET_ACTUATOR_CONTROL_TARGET of GROUP."""
    return WrenchTarget(np.array(m.controls[:3], dtype=float), m.controls[3])


def position_target(m: Message) -> PositionTarget:
    """Return the content of a SET_POSITION_TARGET_LOCAL_NED."""
    velocity = np.array([m.vx, m.vy, m.vz])
    acceleration = np.array([m.afx, m.afy, m.afz])
    mask = m.type_mask
    return PositionTarget(
        mask,
        np.array([m.x, m.y, m.z]),
        np.zeros(3) if mask & VELOCITY_IGNORED else velocity,
        np.zeros(3) if mask & ACCELERATION_IGNORED else acceleration,
        m.yaw,
        0.0 if mask & YAW_RATE_IGNORED else m.yaw_rate,
    )


def vision_message(pose: VisionPose) -> Message:
    """Return the pose as VISION_POSITION_ESTIMATE."""
    return mavlink2.MAVLink_vision_position_estimate_message(
        round(pose.stamp * 1e6),
        *swap_world(pose.position).tolist(),
        *swap_euler(euler_from_quaternion(pose.quaternion)).tolist(),
        covariance(pose.position_deviation, pose.attitude_deviation),
        0,
    )


def covariance(position_deviation: float, attitude_deviation: float) -> list[float]:
    """Return the upper triangle (21,) of the covariance; standard deviations [m] and [rad]."""
    triangle = [0.0] * 21
    for k, place in enumerate(_DIAGONAL):
        triangle[place] = (position_deviation if k < 3 else attitude_deviation) ** 2
    return triangle
