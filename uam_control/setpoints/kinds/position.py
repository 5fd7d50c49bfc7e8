"""Position, velocity, acceleration and yaw of the reference: the autopilot's position control.

tau_p and tau_q are not used; the arm is still controlled by the arm law. Without a reference (idle,
level hold) attitude and thrust are sent.
"""

from __future__ import annotations

import math

from uam_control.coordinates import CHI, CHI_DDOT, CHI_DOT, Z
from uam_control.frames import swap_world
from uam_control.setpoints.kinds.attitude import attitude_setpoint
from uam_control.setpoints.kinds.desired import Desired, Target
from uam_control.setpoints.position_target import PositionTarget


def position_setpoint(desired: Desired) -> Target:
    """Return the reference of `desired` in NED with its yaw; attitude and thrust without one."""
    reference = desired.reference
    if reference is None:
        return attitude_setpoint(desired)
    return PositionTarget(
        0,
        swap_world(reference[CHI]),
        swap_world(reference[CHI_DOT]),
        swap_world(reference[CHI_DDOT]),
        math.pi / 2.0 - float(desired.attitude[CHI, Z]),  # from east, left, to north, right
        -float(desired.attitude[CHI_DOT, Z]),
    )
