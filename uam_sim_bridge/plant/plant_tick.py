"""A tick of `MujocoPlant` in compiled calls: its sensors at the begin, its physics at the end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.maths.hooks import call_all
from uam_control.maths.memory import put
from uam_sim_bridge.plant.effects.acting_effects import EffectArrays
from uam_sim_bridge.plant.engine_step import mj_step
from uam_sim_bridge.plant.observation import Observed, observe
from uam_sim_bridge.plant.physics import PhysicsArrays, actuate, average, begin_period
from uam_sim_bridge.plant.plant import TruthRow
from uam_sim_bridge.plant.sensors import (
    PAYLOAD_POSE,
    VEHICLE_POSE,
    MocapArrays,
    NoiseArrays,
    next_row,
    receive_poses,
    send_pose,
    take_pose,
)


class PlantArrays(NamedTuple):
    """State of a `MujocoPlant`. samples (m, 8 + 3 n): of IMU, joints and gripper, in a ring by the
    tick at which they were taken, taken (m,); numbers (1,): see WHOLE, REAL."""

    physics: PhysicsArrays
    observed: Observed
    truth: TruthRow
    imu_noise: NoiseArrays
    gusts: NoiseArrays
    mocap: MocapArrays
    effects: EffectArrays
    samples: np.ndarray
    taken: np.ndarray
    numbers: np.ndarray


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
    observe(a.observed, noise, sample, m.magnet_gain, a.truth, truth)
    call_all(a.effects.sample)
    put(sample, a.samples[row])
    a.taken[row] = m.tick


@borrowing
def take_due_pose(a: PlantArrays) -> bool:
    """Take the next pose if it is due, see `take_pose`."""
    m, o = a.numbers[0], a.observed
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
    m, physics = a.numbers[0], a.physics
    model, data, steps = int(m.model_at), int(m.data_at), m.steps
    gust = a.gusts.rows[next_row(a.gusts) if m.gusty else 0]
    begin_period(physics, arm_command, magnet, gust, m.tick)
    affect(a.effects, physics.efficiency)
    for _ in range(steps):
        actuate(physics, motors)
        call_all(a.effects.joints)
        error = mj_step(model, data)
        if error:
            return error
        average(physics, 1.0 / steps)
    m.tick += 1
    return 0
