"""Plant: sensors at the begin of a tick, physics at its end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.memory import numbers, record
from uam_sim_bridge.plant import TruthRow
from uam_sim_bridge.plant.mujoco_plant import MujocoPlant
from uam_sim_bridge.plant.observation import Observed, observe, write_grip
from uam_sim_bridge.plant.physics import PhysicsArrays, step_period
from uam_sim_bridge.plant.sensors import BLOCK, Delay, Noise, noisy_pose

RING = 64  # ticks for which samples are kept: more than a sample may be late
POSE = 8  # stamp [s], position (3,), quaternion (4,)
VEHICLE_POSE, PAYLOAD_POSE = 0, 1  # the two poses of a slot


class Sensing(NamedTuple):
    """State of the plant's sensors and physics.

    imu_noise, pose_noise, payload_noise (BLOCK, 6), gusts (BLOCK, 3): the present blocks. samples
    (RING, 6 + 3 n): of IMU and joints, by the tick at which they were taken; poses (RING, 2, POSE):
    by the tick at which they are due, waiting (RING,): whether there is one. memory: `MEMORY`.
    """

    physics: PhysicsArrays
    observed: Observed
    truth: TruthRow
    imu_noise: np.ndarray
    pose_noise: np.ndarray
    payload_noise: np.ndarray
    gusts: np.ndarray
    samples: np.ndarray
    poses: np.ndarray
    waiting: np.ndarray
    grip: np.ndarray
    memory: np.ndarray


USED = ("imu_used", "pose_used", "payload_used", "gusts_used")  # rows of each block of noise
# pose: slot of the pose that arrives at this tick, -1 for none
WHOLE = (
    f"{' '.join(USED)} tick steps model_at data_at imu_late joints_late pose_late tracks gusty pose"
)
REAL = "period magnet_gain payload_top next_pose pose_period"


class SensingPart:
    """The part of a `MujocoPlant`."""

    def __init__(self, plant: MujocoPlant) -> None:
        self._plant = plant
        n = plant.joints
        self.arrays = Sensing(
            plant._arrays,
            plant._observed,
            plant.truth_row,
            np.zeros((BLOCK, 6)),
            np.zeros((BLOCK, 6)),
            np.zeros((BLOCK, 6)),
            np.zeros((BLOCK, 3)),
            np.zeros((RING, 6 + 3 * n)),
            np.zeros((RING, 2, POSE)),
            np.zeros(RING, dtype=np.bool_),
            np.zeros(3),
            record(WHOLE, REAL),
        )
        self._noises = (
            *(plant._imu.noise, plant._mocap.noise, plant._payload_mocap.noise),
            plant._gust,
        )
        self._copied: list[np.ndarray | None] = [None] * 4  # blocks

    def able(self) -> bool:
        """Whether the plant is one whose ticks may be steady."""
        plant = self._plant
        late = plant._imu_delay.ticks, plant._joints_delay.ticks, plant._mocap_delay.ticks
        return plant._effects is None and plant._hinge is None and max(late) < RING - 1

    def load(self, observed: bool) -> int:
        """Copy the state into the arrays; return for how many ticks noise is drawn, 0: not able.

        observed: whether the present tick has been.
        """
        plant, a, left = self._plant, self.arrays, self._draw()
        n, samples = plant.joints, a.samples
        imu_late, joints_late = plant._imu_delay.ticks, plant._joints_delay.ticks
        for delay, columns in (
            (plant._imu_delay, slice(0, 6)),
            (plant._joints_delay, slice(6, 6 + 3 * n)),
        ):
            if not _in_turn(delay, plant.tick + observed):
                return 0
            for due, sample in delay.queue:
                samples[(due - delay.ticks) % RING, columns] = np.concatenate(sample[1:])
        a.waiting[:] = False
        due_poses = plant._mocap_delay.queue
        for due, (stamp, position, quaternion) in due_poses:
            slot = a.poses[due % RING, VEHICLE_POSE]
            slot[0], slot[1:4], slot[4:8] = stamp, position, quaternion
            a.waiting[due % RING] = True
        if plant._tracks_payload:
            payload = plant._payload_delay.queue
            if [due for due, _ in payload] != [due for due, _ in due_poses]:
                return 0
            for due, (stamp, position, quaternion) in payload:
                slot = a.poses[due % RING, PAYLOAD_POSE]
                slot[0], slot[1:4], slot[4:8] = stamp, position, quaternion
        mocap = plant._mocap
        a.memory[0] = (
            *(one.used if one else 0 for one in self._noises),
            *(plant.tick, plant._steps, *plant._addresses),
            *(imu_late, joints_late, plant._mocap_delay.ticks),
            *(plant._tracks_payload, plant._gust is not None, -1),
            *(plant.period, plant._magnet_gain, plant._payload_top, mocap.next, mocap.period),
        )
        return left

    def renew(self) -> int:
        """Draw new blocks of noise in place of those that are used up; return as `load` does."""
        self._store_used()
        left = self._draw()
        for name, noise in zip(USED, self._noises, strict=True):
            self.arrays.memory[name] = noise.used if noise else 0
        return left

    def _draw(self) -> int:
        """Draw the blocks of noise that are due; return for how many ticks they last at least."""
        a, noises = self.arrays, self._noises
        blocks = a.imu_noise, a.pose_noise, a.payload_noise, a.gusts
        imu, pose, payload, gust = map(self._block, range(len(noises)), noises, blocks)
        return min(imu, self._poses(pose), self._poses(payload), gust)

    def _store_used(self) -> None:
        """Copy back how much of the noise was used."""
        for used, noise in zip(self.arrays.memory[0].item(), self._noises, strict=False):
            if noise is not None:
                noise.used = used

    def _poses(self, left: int) -> int:
        """Return for how many ticks the noise of `left` poses lasts at least."""
        plant = self._plant
        return max(left, int((left - 1) * plant._mocap.period / plant.period))

    def _block(self, number: int, noise: Noise | None, rows: np.ndarray) -> int:
        if noise is None:
            return BLOCK
        noise.draw()
        if self._copied[number] is not noise.rows:
            rows[:, : noise.rows.shape[1]] = self._copied[number] = noise.rows
        return BLOCK - noise.used

    def store(self, observed: bool) -> None:
        """Copy the state back; observed: whether the present tick has been."""
        plant, a, values = self._plant, self.arrays, numbers(self.arrays.memory)
        self._store_used()
        tick = plant.tick = values["tick"]
        plant._mocap.next = values["next_pose"]
        first = tick + observed  # the next tick at which samples arrive
        for delay, sample in (
            (plant._imu_delay, self.imu),
            (plant._joints_delay, self.joints),
        ):
            late = delay.ticks
            delay.queue.clear()
            delay.queue.extend((due, sample(due - late)) for due in range(first, first + late))
        late = plant._mocap_delay.ticks
        for delay, which in (
            (plant._mocap_delay, VEHICLE_POSE),
            (plant._payload_delay, PAYLOAD_POSE),
        ):
            delay.queue.clear()
            if which == VEHICLE_POSE or plant._tracks_payload:
                for due in range(first, first + late + 1):
                    if a.waiting[due % RING]:
                        delay.queue.append((due, self.pose(due % RING, which)))

    def imu(self, tick: int) -> tuple[float, np.ndarray, np.ndarray]:
        """Return stamp [s], gyro and specific force (3,) of the sample taken at `tick`, a copy."""
        row = self.arrays.samples[tick % RING].copy()
        return tick * self._plant.period, row[0:3], row[3:6]

    def joints(self, tick: int) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """Return stamp [s], angles, velocities, torques (n,) of `tick`, a copy."""
        n, row = self._plant.joints, self.arrays.samples[tick % RING].copy()
        return tick * self._plant.period, *(row[6 + i * n : 6 + (i + 1) * n] for i in range(3))

    def pose(self, slot: int, which: int) -> tuple[float, np.ndarray, np.ndarray]:
        """Return stamp [s], position and quaternion of a pose, a copy."""
        pose = self.arrays.poses[slot, which].copy()
        return pose.item(0), pose[1:4], pose[4:8]


def _in_turn(delay: Delay, tick: int) -> bool:
    """Return whether a sample waits for each of the next ticks."""
    return [due for due, _ in delay.queue] == list(range(tick, tick + delay.ticks))


@borrowing
def sense(s: Sensing, truth: np.ndarray) -> None:
    """Sample the sensors, as `MujocoPlant.observe`; the truth to a row (truth.width,)."""
    m = s.memory[0]
    time = m.tick * m.period
    sample = s.samples[m.tick % RING]
    observe(s.observed, s.imu_noise[m.imu_used], sample, m.magnet_gain, s.truth, truth)
    m.imu_used += 1
    if not time + 1e-9 < m.next_pose:
        if time > m.next_pose + m.pose_period:
            m.next_pose = time
        m.next_pose += m.pose_period
        due = (m.tick + m.pose_late) % RING
        s.waiting[due] = True
        pose = s.poses[due, VEHICLE_POSE]
        pose[0] = time
        noise = s.pose_noise[m.pose_used]
        noisy_pose(s.observed.position, s.observed.quaternion, noise, pose[1:4], pose[4:8])
        m.pose_used += 1
        if m.tracks:
            pose = s.poses[due, PAYLOAD_POSE]
            pose[0] = time
            write_grip(s.observed.payload, m.payload_top, s.grip)
            noise = s.payload_noise[m.payload_used]
            noisy_pose(s.grip, s.observed.payload[3:7], noise, pose[1:4], pose[4:8])
            m.payload_used += 1
    slot = m.tick % RING
    m.pose = slot if s.waiting[slot] else -1
    s.waiting[slot] = False


@jit
def stamp_of(time: float) -> int:
    """Return the stamp [ns] of a time [s]; see `nanoseconds`."""
    return int(np.rint(time * 1e6)) * 1000


@borrowing
def step(s: Sensing, motors: np.ndarray, arm_command: np.ndarray, magnet: bool) -> int:
    """Advance the physics by a period, as `MujocoPlant.step`; return 0 or an error's address."""
    m = s.memory[0]
    gust = s.gusts[m.gusts_used]
    if m.gusty:
        m.gusts_used += 1
    error = step_period(
        s.physics,
        motors,
        arm_command,
        magnet,
        gust,
        m.tick,
        int(m.model_at),
        int(m.data_at),
        m.steps,
    )
    if not error:
        m.tick += 1
    return error
