"""Commands of the joints → goal registers of the servos, within the limits of angle and current."""

import math
from dataclasses import dataclass

import numpy as np

from uam_sim_bridge.devices.dynamixel.chain import ServoDescription
from uam_sim_bridge.devices.dynamixel.parameters import ArmDriverParameters


def friction_torque(coulomb: float, viscous: float, velocity: float, speed: float) -> float:
    """Return the friction torque [N m] at a desired velocity [rad/s].

    coulomb [N m]; viscous [N m s/rad]; speed [rad/s]: width of the smooth sign, tanh(velocity /
    speed), which has no step when the desired velocity changes its sign.
    """
    return coulomb * math.tanh(velocity / speed) + viscous * velocity


@dataclass(frozen=True)
class Command:
    """Efforts (n,) [N m] or goals (n,) [rad], desired velocities (n,) [rad/s], time [s]."""

    values: np.ndarray
    velocity: np.ndarray
    time: float


def goal_current(
    servo: ServoDescription,
    effort: float,
    velocity: float,
    angle: float,
    parameters: ArmDriverParameters,
) -> int:
    """Return the register Goal Current of a joint.

    effort [N m]; velocity [rad/s]: desired; angle [rad]: measured. An effort that drives further
    into a limit of the angle is removed.
    """
    if parameters.friction_compensation:
        effort += friction_torque(servo.coulomb, servo.viscous, velocity, parameters.friction_speed)
    if (angle >= servo.high and effort > 0.0) or (angle <= servo.low and effort < 0.0):
        return 0
    return servo.current(effort)


def goal_position(servo: ServoDescription, goal: float, turns: int) -> int | None:
    """Return the register Goal Position of a goal [rad] within the limits; None for NaN.

    turns [counts]: see `ServoDescription.turned`.
    """
    if math.isnan(goal):
        return None
    return servo.counts(min(max(goal, servo.low), servo.high)) - turns
