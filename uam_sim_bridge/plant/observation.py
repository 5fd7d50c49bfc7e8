"""What sensors and recording see of a MuJoCo vehicle, written in one compiled call per tick."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uam_control.coordinates import ALPHA, CHI, CHI_DDOT, CHI_DOT, ROLL, X
from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.rotations import euler_from_quaternion
from uam_sim_bridge.plant.gripper import write_grip
from uam_sim_bridge.plant.plant import TruthRow
from uam_sim_bridge.plant.sensors import disturbed, quantised


class Observed(NamedTuple):
    """What is observed, as arrays that never move; most are views into MuJoCo's.

    position, velocity (3,) [m, m/s, ENU]; quaternion (4,) [w x y z], FLU → ENU; rates (3,) [rad/s,
    FLU]; alpha, alpha_dot, alpha_ddot (n,) [rad, rad/s, rad/s^2]; base_acceleration (6,): linear
    [m/s^2, ENU] and angular [rad/s^2, FLU]. specific_force (3,) [m/s^2, FLU], imu_bias (6,):
    [rad/s, m/s^2]; servo_torque (n,) [N m]; encoder_units (2,): see `quantised`. rotor_thrust
    (rotors,) [N]; payload (7,): position [m] and quaternion; magnet_control (1,): part of the
    holding force; swing (1,) [rad]: angle of the magnet's pivot. opening, grip_force: of `Fingers`.
    """

    position: np.ndarray
    quaternion: np.ndarray
    velocity: np.ndarray
    rates: np.ndarray
    alpha: np.ndarray
    alpha_dot: np.ndarray
    base_acceleration: np.ndarray
    alpha_ddot: np.ndarray
    specific_force: np.ndarray
    imu_bias: np.ndarray
    servo_torque: np.ndarray
    encoder_units: np.ndarray
    rotor_thrust: np.ndarray
    payload: np.ndarray
    magnet_control: np.ndarray
    swing: np.ndarray
    opening: np.ndarray
    grip_force: np.ndarray


@borrowing
def observe(
    o: Observed,
    noise: np.ndarray,
    samples: np.ndarray,
    magnet_gain: float,
    at: TruthRow,
    truth: np.ndarray,
) -> None:
    """Write the samples of IMU and joints, see `SensorArrays`, and the true values of a tick.

    noise (6,): of the IMU; samples (8 + 3 n,); magnet_gain, at, truth: of `write_truth`.
    """
    joints = len(o.alpha)
    angles, speeds, torques = 6, 6 + joints, 6 + 2 * joints
    disturbed(o.rates, o.specific_force, noise, o.imu_bias, samples[0:3], samples[3:6])
    quantised(
        o.alpha, o.alpha_dot, o.encoder_units, samples[angles:speeds], samples[speeds:torques]
    )
    for i in range(joints):
        samples[torques + i] = o.servo_torque[i]
    write_grip(o.opening, o.grip_force, samples[torques + joints :])
    write_truth(o, magnet_gain, at, truth)


@borrowing
def write_truth(o: Observed, magnet_gain: float, at: TruthRow, row: np.ndarray) -> None:
    """Write the true values to row (at.width,); magnet_gain [N]: full holding force."""
    size = ALPHA + len(o.alpha)
    write_state(o, row[at.state : at.state + 3 * size].reshape((3, size)))
    for i in range(len(o.rotor_thrust)):
        row[at.rotor_thrust + i] = o.rotor_thrust[i]
    for i in range(7):
        row[at.payload + i] = o.payload[i]
    row[at.magnet] = o.magnet_control[0] * magnet_gain
    row[at.magnet + 1] = o.swing[0]
    write_grip(o.opening, o.grip_force, row[at.grip :])


@jit
def write_state(o: Observed, state: np.ndarray) -> None:
    """Write chi, chi_dot, chi_ddot into state (3, 6 + n), see uam_control.coordinates."""
    euler = euler_from_quaternion(o.quaternion)
    for i in range(3):
        state[CHI, X + i], state[CHI, ROLL + i] = o.position[i], euler[i]
        state[CHI_DOT, X + i], state[CHI_DOT, ROLL + i] = o.velocity[i], o.rates[i]
        state[CHI_DDOT, X + i] = o.base_acceleration[i]
        state[CHI_DDOT, ROLL + i] = o.base_acceleration[3 + i]
    for i in range(len(o.alpha)):
        state[CHI, ALPHA + i], state[CHI_DOT, ALPHA + i] = o.alpha[i], o.alpha_dot[i]
        state[CHI_DDOT, ALPHA + i] = o.alpha_ddot[i]
