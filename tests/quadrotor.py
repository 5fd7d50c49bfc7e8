"""A rigid quadrotor for tests of bridge and autopilot, independent of the MuJoCo plant.

ENU/FLU; rotors in PX4's order; thrust curve 0.3 u^2 + 0.7 u; lag 12.5 ms up, 25 ms down; a ground
at z = 0 that holds the vehicle level.
"""

import numpy as np

from uam_control.maths.rotations import (
    matrix_from_quaternion,
    quaternion_from_rotation_vector,
    quaternion_multiply,
)

GRAVITY = 9.81
MASS = 2.2
INERTIA = np.array([0.0165, 0.0186, 0.0250])
ARM, MOMENT, FULL = 0.171, 0.016, 10.34
X = ARM * np.array([1.0, -1.0, 1.0, -1.0])
Y = ARM * np.array([-1.0, 1.0, 1.0, -1.0])  # FLU: left
REACTION = MOMENT * np.array([-1.0, -1.0, 1.0, 1.0])  # counter-clockwise rotors turn it clockwise


class Quadrotor:
    """State and 4 ms steps; `gyro` and `accel` (specific force) are FLU and without noise."""

    def __init__(self, mass=MASS, height=0.0):
        self.mass = mass
        self.time = 0.0
        self.position = np.array([0.0, 0.0, height])
        self.velocity = np.zeros(3)
        self.quaternion = np.array([1.0, 0.0, 0.0, 0.0])
        self.gyro = np.zeros(3)
        self.accel = np.array([0.0, 0.0, GRAVITY])
        self.thrusts = np.zeros(4)

    def hover(self):
        """Set the rotor thrusts for hover."""
        self.thrusts[:] = self.mass * GRAVITY / 4
        return self

    def step(self, motors, dt=0.004, substeps=4):
        """Advance by dt with motor commands (4,) 0..1."""
        u = np.clip(motors, 0.0, 1.0)
        desired = FULL * (0.3 * u * u + 0.7 * u)
        h = dt / substeps
        for _ in range(substeps):
            lag = np.where(desired > self.thrusts, 0.0125, 0.025)
            self.thrusts += (desired - self.thrusts) * h / (lag + h)
            self._move(h)
        self.time += dt

    def _move(self, h):
        rotation = matrix_from_quaternion(self.quaternion)
        force = np.array([0.0, 0.0, self.thrusts.sum()])
        torque = np.array([Y @ self.thrusts, -X @ self.thrusts, REACTION @ self.thrusts])
        acceleration = rotation @ force / self.mass - [0.0, 0.0, GRAVITY]
        if self.position[2] <= 0.0 and (self.velocity[2] < 0.0 or acceleration[2] <= 0.0):
            stop = -self.velocity / h  # the accelerometer measures the ground's impulse
            self.velocity[:] = self.gyro[:] = 0.0
            self.position[2] = 0.0
            self.accel = rotation.T @ (np.clip(stop, -50.0, 50.0) + [0.0, 0.0, GRAVITY])
            return
        self.accel = force / self.mass
        self.velocity += h * acceleration
        self.position += h * self.velocity
        self.gyro += h * (torque - np.cross(self.gyro, INERTIA * self.gyro)) / INERTIA
        q = quaternion_multiply(self.quaternion, quaternion_from_rotation_vector(h * self.gyro))
        self.quaternion = q / np.linalg.norm(q)
