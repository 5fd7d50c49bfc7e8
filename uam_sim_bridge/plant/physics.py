"""The vehicle's arrays, and the physics of one control period around MuJoCo's steps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_sim_bridge.plant.actuators import (
    RotorArrays,
    ServoArrays,
    joint_step,
    receive,
    rotor_step,
)
from uam_sim_bridge.plant.gripper import move_fingers
from uam_sim_bridge.plant.magnet import pull_fraction


class Body(NamedTuple):
    """The vehicle and its surroundings, as arrays that never move; most are views into MuJoCo's."""

    rotors: RotorArrays
    servos: ServoArrays
    position: np.ndarray  # (3,) [m, ENU]
    quaternion: np.ndarray  # (4,) [w x y z], FLU → ENU
    velocity: np.ndarray  # (3,) [m/s, ENU]
    rates: np.ndarray  # (3,) [rad/s, FLU]
    alpha: np.ndarray  # (n,) [rad]
    alpha_dot: np.ndarray  # (n,) [rad/s]
    base_acceleration: np.ndarray  # (6,) linear [m/s^2, ENU] and angular [rad/s^2, FLU]
    alpha_ddot: np.ndarray  # (n,) [rad/s^2]
    sensed_force: np.ndarray  # (3,) [m/s^2, FLU] specific force of a physics step
    specific_force: np.ndarray  # (3,) [m/s^2, FLU] the mean of a control period
    thrust_control: np.ndarray  # see `rotor_step`
    torque_control: np.ndarray  # see `joint_step`
    force: np.ndarray  # (3,) [N, ENU] on the base
    drag: np.ndarray  # (3,) [N s/m]
    wind: np.ndarray  # (3,) [m/s] see `blow`
    wind_mean: np.ndarray  # (3,) [m/s] see `blow`
    gust_keep: np.ndarray  # (1,) see `blow`
    payload: np.ndarray  # (7,) position [m] and quaternion
    face: np.ndarray  # see `pull_fraction`
    payload_centre: np.ndarray  # see `pull_fraction`
    payload_axes: np.ndarray  # see `pull_fraction`
    gap_constants: np.ndarray  # see `pull_fraction`
    magnet_control: np.ndarray  # (1,) part of the holding force
    swing: np.ndarray  # (1,) [rad] angle of the magnet's pivot
    finger_ends: np.ndarray  # of `Fingers`
    finger_goal: np.ndarray  # of `Fingers`
    opening: np.ndarray  # of `Fingers`
    grip_force: np.ndarray  # of `Fingers`
    imu_bias: np.ndarray  # (6,) [rad/s, m/s^2]
    encoder_units: np.ndarray  # (2,) see `quantised`


@borrowing
def begin_period(
    a: Body, arm_command: np.ndarray, magnet: bool, gust: np.ndarray, tick: int
) -> None:
    """Write the loads of control period `tick`: drag -c (v - wind), pull of the magnet, fingers.

    arm_command (n,): sent now, see `receive`; gust (3,): see `blow`. Sets the specific force to 0,
    for the mean over the physics steps.
    """
    receive(arm_command, tick, a.servos)
    blow(a.wind, a.wind_mean, a.gust_keep[0], gust)
    for i in range(3):
        a.force[i] = a.drag[i] * (a.wind[i] - a.velocity[i])
        a.specific_force[i] = 0.0
    pull = (
        pull_fraction(a.face, a.payload_centre, a.payload_axes, a.gap_constants) if magnet else 0.0
    )
    a.magnet_control[0] = pull
    move_fingers(a.finger_ends, a.finger_goal, magnet)


@borrowing
def actuate(a: Body, commands: np.ndarray) -> None:
    """Write thrusts and joint torques of the next physics step; commands (rotors,): 0..1."""
    rotor_step(commands, a.rotors, a.thrust_control)
    joint_step(a.servos, a.alpha, a.alpha_dot, a.torque_control)


@borrowing
def average(a: Body, weight: float) -> None:
    """Add `weight` times the specific force of a physics step to its mean."""
    for i in range(3):
        a.specific_force[i] += weight * a.sensed_force[i]


@borrowing
def blow(wind: np.ndarray, mean: np.ndarray, keep: float, gust: np.ndarray) -> None:
    """Advance wind (3,) by a control period: it returns to `mean` by 1 - keep; gust (3,) is added.

    All in [m/s, ENU]. Without gusts the wind is its mean and stays so.
    """
    for i in range(3):
        wind[i] += (1.0 - keep) * (mean[i] - wind[i]) + gust[i]
