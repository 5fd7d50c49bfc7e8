"""Attitude and thrust: the autopilot's own attitude loop controls, tau_q is not used."""

from __future__ import annotations

from uam_control.coordinates import CHI
from uam_control.frames import swap_quaternion
from uam_control.maths.rotations import quaternion_from_euler
from uam_control.setpoints.attitude_target import AttitudeTarget
from uam_control.setpoints.kinds.desired import Desired


def attitude_setpoint(desired: Desired) -> AttitudeTarget:
    """Return attitude (FRD → NED) and thrust of `desired`; the body rates are ignored."""
    quaternion = swap_quaternion(quaternion_from_euler(desired.attitude[CHI]))
    return AttitudeTarget.of_attitude(quaternion, desired.thrust)
