"""What sensors and recording see of a MuJoCo vehicle, written in one compiled call per tick."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uam_control.coordinates import ALPHA, CHI, CHI_DDOT, CHI_DOT, ROLL, X
from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.kept_tuple import call_all
from uam_control.maths.memory import put
from uam_control.maths.rotations import euler_from_quaternion
from uam_sim_bridge.plant.effects.acting_effects import EffectArrays
from uam_sim_bridge.plant.engine_step import mj_step
from uam_sim_bridge.plant.gripper import write_grip
from uam_sim_bridge.plant.physics import Body, actuate, average, begin_period
from uam_sim_bridge.plant.plant import TruthRow
from uam_sim_bridge.plant.sensors import (
    PAYLOAD_POSE,
    VEHICLE_POSE,
    MocapArrays,
    NoiseArrays,
    disturbed,
    next_row,
    quantised,
    receive_poses,
    send_pose,
    take_pose,
)


@borrowing
def observe(
    o: Body,
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
        samples[torques + i] = o.servos.torque[i]
    write_grip(o.opening, o.grip_force, samples[torques + joints :])
    write_truth(o, magnet_gain, at, truth)


@borrowing
def write_truth(o: Body, magnet_gain: float, at: TruthRow, row: np.ndarray) -> None:
    """Write the true values to row (at.width,); magnet_gain [N]: full holding force."""
    size = ALPHA + len(o.alpha)
    write_state(o, row[at.state : at.state + 3 * size].reshape((3, size)))
    for i in range(len(o.rotors.thrust)):
        row[at.rotor_thrust + i] = o.rotors.thrust[i]
    for i in range(7):
        row[at.payload + i] = o.payload[i]
    row[at.magnet] = o.magnet_control[0] * magnet_gain
    row[at.magnet + 1] = o.swing[0]
    write_grip(o.opening, o.grip_force, row[at.grip :])


@jit
def write_state(o: Body, state: np.ndarray) -> None:
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


class PlantArrays(NamedTuple):
    """State of a `MujocoPlant`."""

    body: Body
    truth: TruthRow
    imu_noise: NoiseArrays
    gusts: NoiseArrays
    mocap: MocapArrays
    effects: EffectArrays
    samples: np.ndarray  # (m, 8 + 3 n) of IMU, joints and gripper, in a ring by their tick
    taken: np.ndarray  # (m,) tick at which they were taken
    numbers: np.ndarray  # (1,) see WHOLE, REAL


# steps: of the physics in a period; model_at, data_at: addresses of MuJoCo's structures; gusty:
# whether there are gusts; imu_late, joints_late [ticks]; magnet_gain [N]: full holding force
WHOLE = "tick steps model_at data_at gusty imu_late joints_late"
REAL = "period magnet_gain"


@borrowing
def take_samples(a: PlantArrays, truth: np.ndarray) -> None:
    """Take the samples of IMU and joints; write the true values to a row (truth.width,)."""
    m = a.numbers[0]
    row = m.tick % len(a.samples)
    noise = a.imu_noise.rows[next_row(a.imu_noise)]
    sample = a.effects.row
    observe(a.body, noise, sample, m.magnet_gain, a.truth, truth)
    call_all(a.effects.sample)
    put(sample, a.samples[row])
    a.taken[row] = m.tick


@borrowing
def take_due_pose(a: PlantArrays) -> bool:
    """Take the next pose if it is due, see `take_pose`."""
    m, o = a.numbers[0], a.body
    place = o.position, o.quaternion, o.velocity, o.rates, o.payload
    return take_pose(a.mocap, m.tick * m.period, m.period, *place)


@borrowing
def sense(a: PlantArrays, truth: np.ndarray) -> None:
    """Sample the sensors, as `MujocoPlant.observe`."""
    tick, mocap, pose = a.numbers[0].tick, a.mocap, a.effects.numbers[0]
    take_samples(a, truth)
    while take_due_pose(a):
        m = mocap.numbers[0]
        pose.lost, pose.late = 0, 0.0
        call_all(a.effects.pose)
        due = tick + m.ticks + int(np.rint(pose.late / a.numbers[0].period))
        if not pose.lost:
            send_pose(mocap, VEHICLE_POSE, due)
        if m.tracks:
            send_pose(mocap, PAYLOAD_POSE, due)
    receive_poses(mocap, tick)


@borrowing
def affect(e: EffectArrays, efficiency: np.ndarray) -> None:
    """Let the effects act on the loads of a control period and on efficiency (rotors,)."""
    if len(e.tick):
        e.lift[:] = 1.0
        call_all(e.tick)
        for i in range(len(efficiency)):
            efficiency[i] = e.factor[i] * e.lift[i]


@borrowing
def step(a: PlantArrays, motors: np.ndarray, arm_command: np.ndarray, magnet: bool) -> int:
    """Advance the physics by a period, as `MujocoPlant.step`; return 0 or an error's address."""
    m, body = a.numbers[0], a.body
    model, data, steps = int(m.model_at), int(m.data_at), m.steps
    gust = a.gusts.rows[next_row(a.gusts) if m.gusty else 0]
    begin_period(body, arm_command, magnet, gust, m.tick)
    affect(a.effects, body.rotors.efficiency)
    for _ in range(steps):
        actuate(body, motors)
        call_all(a.effects.joints)
        error = mj_step(model, data)
        if error:
            return error
        average(body, 1.0 / steps)
    m.tick += 1
    return 0
