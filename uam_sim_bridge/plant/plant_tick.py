"""A tick of `MujocoPlant` in compiled calls: its sensors at the begin, its physics at the end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
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
    take_poses,
)


class PlantArrays(NamedTuple):
    """State of a `MujocoPlant`. samples (m, 6 + 3 n): of IMU and joints, in a ring by the tick at
    which they were taken, taken (m,); numbers (1,): see WHOLE, REAL."""

    physics: PhysicsArrays
    observed: Observed
    truth: TruthRow
    imu_noise: NoiseArrays
    gusts: NoiseArrays
    mocap: MocapArrays
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
    observe(a.observed, noise, a.samples[row], m.magnet_gain, a.truth, truth)
    a.taken[row] = m.tick


@borrowing
def take_due_poses(a: PlantArrays) -> bool:
    """Take the poses that are due, see `take_poses`."""
    m, o = a.numbers[0], a.observed
    return take_poses(a.mocap, m.tick * m.period, o.position, o.quaternion, o.payload)


@borrowing
def sense(a: PlantArrays, truth: np.ndarray) -> None:
    """Sample the sensors, as `MujocoPlant.observe`."""
    tick, mocap = a.numbers[0].tick, a.mocap
    take_samples(a, truth)
    if take_due_poses(a):
        m = mocap.numbers[0]
        send_pose(mocap, VEHICLE_POSE, tick + m.ticks)
        if m.tracks:
            send_pose(mocap, PAYLOAD_POSE, tick + m.ticks)
    receive_poses(mocap, tick)


@borrowing
def step(a: PlantArrays, motors: np.ndarray, arm_command: np.ndarray, magnet: bool) -> int:
    """Advance the physics by a period, as `MujocoPlant.step`; return 0 or an error's address."""
    m, physics = a.numbers[0], a.physics
    model, data, steps = int(m.model_at), int(m.data_at), m.steps
    gust = a.gusts.rows[next_row(a.gusts) if m.gusty else 0]
    begin_period(physics, arm_command, magnet, gust, m.tick)
    for _ in range(steps):
        actuate(physics, motors)
        error = mj_step(model, data)
        if error:
            return error
        average(physics, 1.0 / steps)
    m.tick += 1
    return 0
