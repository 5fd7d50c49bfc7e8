"""Another physics engine: one class in numpy, to show what the simulator needs of a plant.

A rigid quadrotor with the vehicle's mass; each joint of the arm turns by itself, without weight and
without an effect on the body. No payload, no latency; noise on the motion capture's position alone,
as a pose that repeats counts as a frozen tracker.
"""

from __future__ import annotations

import numpy as np
from quadrotor import Quadrotor

from uam_control.maths.rotations import euler_from_quaternion, matrix_from_quaternion
from uam_sim_bridge.plant import Plant, Samples, Truth

JOINT_INERTIA, JOINT_DAMPING = 0.02, 0.05  # [kg m^2], [N m s/rad]
MOCAP_TICKS, MOCAP_NOISE = 2, 1e-4  # [m]


class RigidBodyPlant(Plant):
    """See `Plant`."""

    DISTURBABLE = False

    def __init__(self, vehicle, payload_mass, seed, arm_start=(), disturbed=False):
        super().__init__(vehicle)
        self.body = Quadrotor(mass=vehicle.description.mass)
        self.alpha = np.array(arm_start or vehicle.description.stowed, dtype=float)
        self.alpha_dot, self.effort = np.zeros(self.joints), np.zeros(self.joints)
        self.noise = np.random.default_rng(seed)

    def sense(self):
        now, body = self.time, self.body
        imu = (now, body.gyro.copy(), body.accel.copy())
        joints = (now, self.alpha.copy(), self.alpha_dot.copy(), self.effort.copy())
        position = body.position + self.noise.normal(0.0, MOCAP_NOISE, 3)
        mocap = (now, position, body.quaternion.copy())
        return Samples(imu, joints, None if self.tick % MOCAP_TICKS else mocap, imu)

    def step(self, motor_commands, arm_command, magnet):
        self.body.step(motor_commands, self.period)
        self.effort[:] = arm_command
        acceleration = (self.effort - JOINT_DAMPING * self.alpha_dot) / JOINT_INERTIA
        self.alpha_dot += self.period * acceleration
        self.alpha += self.period * self.alpha_dot
        self.tick += 1

    def truth(self):
        body = self.body
        state = np.zeros((3, 6 + self.joints))
        state[0] = *body.position, *euler_from_quaternion(body.quaternion), *self.alpha
        state[1] = *body.velocity, *body.gyro, *self.alpha_dot
        state[2, :3] = matrix_from_quaternion(body.quaternion) @ body.accel - [0.0, 0.0, 9.81]
        return Truth(
            state=state,
            quaternion=body.quaternion.copy(),
            payload_position=np.full(3, np.nan),
            payload_quaternion=np.full(4, np.nan),
            magnet_force=0.0,
            magnet_swing=0.0,
            rotor_speed=np.sqrt(body.thrusts / self.vehicle.description.rotor.thrust_coefficient),
            rotor_thrust=body.thrusts.copy(),
        )
