"""The setpoint types by name: which part of the desired motion is sent, what of the laws acts.

See docs/autopilot.md, Attitude, position or torque. With each the arm law controls the arm. Without
a reference (idle, level hold) attitude and thrust are sent.

A new type is a function and a line in SETPOINTS.
"""

import math
from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import CHI, CHI_DDOT, CHI_DOT, Z
from uam_control.frames import swap_body, swap_quaternion, swap_world
from uam_control.maths.rotations import quaternion_from_euler
from uam_control.setpoints.targets import (
    RATES,
    UPRIGHT,
    AttitudeTarget,
    Desired,
    PositionTarget,
    SetpointType,
    Target,
    WrenchTarget,
)
from uam_control.settings.parameter_set import ParameterSet, choice, number


def attitude_setpoint(desired: Desired) -> AttitudeTarget:
    """Return attitude (FRD → NED) and thrust of `desired`; the body rates are ignored."""
    quaternion = swap_quaternion(quaternion_from_euler(desired.attitude[CHI]))
    return AttitudeTarget.of_attitude(quaternion, desired.thrust)


def rates_setpoint(desired: Desired) -> AttitudeTarget:
    """Return body rates (FRD) and thrust of `desired`; the attitude is ignored."""
    return AttitudeTarget(RATES, UPRIGHT, swap_body(desired.rates), desired.thrust)


def wrench_setpoint(desired: Desired) -> Target:
    """Return torque (FRD) and thrust of `desired`; body rates where no law commands a torque."""
    if desired.torque is None:
        return rates_setpoint(desired)
    return WrenchTarget(swap_body(np.clip(desired.torque, -1.0, 1.0)), desired.thrust)


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


WRENCH = "wrench"
SETPOINTS: dict[str, SetpointType] = {
    "rates": rates_setpoint,
    "attitude": attitude_setpoint,
    "position": position_setpoint,
    WRENCH: wrench_setpoint,
}


@dataclass(frozen=True)
class SetpointParameters(ParameterSet):
    """Type of the setpoints that the bridge sends."""

    setpoint: str = choice(
        "rates",
        "what is sent: rates, attitude or wrench (torque) with the thrust, or position; only rates "
        "and wrench act as tau_q",
        SETPOINTS,
    )

    setpoint_rate: float = number(
        0.0,
        "rate of new setpoints; in between the last one is repeated; 0 = every tick",
        "Hz",
        0.0,
        1e3,
    )

    @property
    def type(self) -> SetpointType:
        """The function that makes the setpoints."""
        return SETPOINTS[self.setpoint]
