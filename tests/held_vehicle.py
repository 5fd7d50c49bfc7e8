"""A vehicle in the hands of a person: true motion → samples of sensors, maybe wired wrongly."""

import math
from dataclasses import dataclass, field

import numpy as np

from uam_control.maths.rotations import (
    euler_from_quaternion,
    matrix_from_quaternion,
    quaternion_from_rotation_vector,
    quaternion_multiply,
)
from uam_lab.preflight.checklist.observation import GyroIntegral, Sample, rotation_vector
from uam_lab.preflight.checklist.step import Situation, StepState

PERIOD = 0.04  # [s] between two samples
GRAVITY = 9.81
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


@dataclass
class Wiring:
    """What is built in wrongly. Rotations (4,): mocap's world, its body, the IMU in the body.

    gyro, force: signs of single sensors; joints: (index, sign) read in place of each joint;
    commands (3, 3): what the commanded rates are multiplied with.
    """

    world: np.ndarray = field(default_factory=IDENTITY.copy)
    body: np.ndarray = field(default_factory=IDENTITY.copy)
    imu: np.ndarray = field(default_factory=IDENTITY.copy)
    gyro: float = 1.0
    force: float = 1.0
    joints: tuple = ((0, 1), (1, 1))
    commands: np.ndarray = field(default_factory=lambda: np.eye(3))


class HeldVehicle:
    """Moves as the steps ask; `time` [s]; noise: multiplies noise and biases of all sensors."""

    def __init__(self, wiring=None, seed=0, noise=0.0, yaw=0.0):
        self.wiring, self.time = wiring or Wiring(), 0.0
        self._random, self._noise = np.random.default_rng(seed), noise
        self.position = np.array([0.4, -0.3, 0.2])
        self.heading = quaternion_from_rotation_vector(np.array([0.0, 0.0, yaw]))
        self.turn = np.zeros(3)  # [rad] about the body's axes, from level with this heading
        self.joints = np.array([0.0, math.pi / 2])
        self._gyro, self._before, self._level = GyroIntegral(), None, None
        self._gyro_bias = 0.01 * noise * self._random.uniform(-1, 1, 3)
        self._force_bias = 0.2 * noise * self._random.uniform(-1, 1, 3)

    def _shaken(self, size, count):
        return self._noise * size * self._random.normal(size=count)

    def sample(self):
        """Return the sample after PERIOD."""
        self.time += PERIOD
        wiring = self.wiring
        tremor = quaternion_from_rotation_vector(self._shaken(0.002, 3))
        truth = quaternion_multiply(
            self.heading, quaternion_multiply(quaternion_from_rotation_vector(self.turn), tremor)
        )
        inverse = wiring.body * np.array([1.0, -1.0, -1.0, -1.0])
        seen = quaternion_multiply(wiring.world, quaternion_multiply(truth, inverse))
        mount = matrix_from_quaternion(wiring.imu)
        rate = np.zeros(3)
        if self._before is not None:
            rate = rotation_vector(self._before, truth) / PERIOD
        self._before = truth
        rate = wiring.gyro * (mount @ rate) + self._gyro_bias + self._shaken(0.003, 3)
        force = matrix_from_quaternion(truth)[2] * GRAVITY
        force = wiring.force * (mount @ force) + self._force_bias + self._shaken(0.1, 3)
        self._gyro.add(self.time, rate)
        position = matrix_from_quaternion(wiring.world) @ self.position
        read = [sign * self.joints[index] for index, sign in wiring.joints]
        if self._level is None:  # the mission's reference: level, with the first heading
            yaw = euler_from_quaternion(seen)[2]
            self._level = quaternion_from_rotation_vector(np.array([0.0, 0.0, yaw]))
        error = rotation_vector(self._level, seen)
        return Sample(
            self.time,
            position + self._shaken(0.0005, 3),
            seen,
            self._gyro.value.copy(),
            force,
            rate,
            np.array(read),
            wiring.commands @ (-3.0 * error) + self._shaken(0.05, 3),
        )

    def go(self, step, duration, **target):
        """Move to `target` (turn, shift, joints) within `duration` [s] while `step` looks on."""
        count = max(1, round(duration / PERIOD))
        begin = {name: getattr(self, name).copy() for name in target}
        for i in range(count):
            part = 0.5 - 0.5 * math.cos(math.pi * (i + 1) / count)
            for name, end in target.items():
                setattr(self, name, begin[name] + part * (np.asarray(end) - begin[name]))
            step.update(Situation(self.time, self.sample()))
            if step.state is StepState.PASSED:
                return


def axis_vector(axis, size, count=3):
    vector = np.zeros(count)
    vector[axis] = size
    return vector


def perform(step, vehicle, keep=1.0):
    """Do what a step of this name asks; return its state at the end."""
    step.begin(vehicle.time)
    vehicle.go(step, 1.2)
    if step.name in ("tilt_roll", "tilt_pitch"):
        axis = ("tilt_roll", "tilt_pitch").index(step.name)
        for size in (0.3, -0.3):
            vehicle.go(step, 1.0, turn=axis_vector(axis, size))
            vehicle.go(step, keep)
        vehicle.go(step, 1.0, turn=np.zeros(3))
    elif step.name == "yaw_turn":
        vehicle.go(step, 1.0, turn=axis_vector(2, 0.5))
        vehicle.go(step, keep)
        vehicle.go(step, 1.0, turn=np.zeros(3))
    elif step.name in ("move_forward", "lift"):
        begin = vehicle.position.copy()
        nose = matrix_from_quaternion(vehicle.heading)[:, 0]
        way = 0.4 * nose if step.name == "move_forward" else np.array([0.0, 0.0, 0.3])
        vehicle.go(step, 1.0, position=begin + way)
        vehicle.go(step, keep)
        vehicle.go(step, 1.0, position=begin)
    else:
        index = int(step.name.rpartition("_")[2]) - 1
        begin = vehicle.joints.copy()
        vehicle.go(step, 1.0, joints=begin + axis_vector(index, 0.3, len(begin)))
        vehicle.go(step, keep)
        vehicle.go(step, 1.0, joints=begin)
    vehicle.go(step, 1.2)
    return step.state
