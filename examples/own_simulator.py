"""Your own simulator: a rigid multicopter in numpy, without payload, takes the place of MuJoCo.

python examples/own_simulator.py direct hover [FOLDER]
"""

import sys
from pathlib import Path

import numpy as np

from uam_control.maths import rotations as so3
from uam_lab import Flight
from uam_lab.records.results.result_folder import new_folder
from uam_sim_bridge.plant import Plant, Samples, Truth

INERTIA, UP = np.array([0.0165, 0.0186, 0.0250]), np.array([0.0, 0.0, 9.81])  # [kg m^2], [m/s^2]


class OwnSimulator(Plant):
    """Position p, velocity v, body rates w, attitude q; the arm stands still."""

    DISTURBABLE = False

    def __init__(self, vehicle, payload_mass, seed, arm_start=(), disturbed=False):
        super().__init__(vehicle)
        (self.p, self.v, self.w), self.force = np.zeros((3, 3)), UP  # force: specific, body
        self.q, self.noise = np.array([1.0, 0.0, 0.0, 0.0]), np.random.default_rng(seed)
        self.arm, self.still = np.array(arm_start, dtype=float), np.zeros(self.joints)
        rotors, ratio = vehicle.description.rotors, vehicle.description.rotor.moment_ratio
        x, y, _ = np.array([rotor.position for rotor in rotors]).T
        turn = [-ratio if rotor.counter_clockwise else ratio for rotor in rotors]
        self.torques, self.thrust = np.array([y, -x, turn]), np.zeros(len(rotors))

    def sense(self):
        pose = self.time, self.p + self.noise.normal(0.0, 1e-4, 3), self.q
        imu, joints = (self.time, self.w, self.force), (self.time, self.arm, self.still, self.still)
        return Samples(imu, joints, None if self.tick % 2 else pose, imu)

    def step(self, motor_commands, arm_command, magnet):
        vehicle, h = self.vehicle.description, self.period
        f, u = vehicle.rotor.curve_factor, np.clip(motor_commands, 0.0, 1.0)
        thrust = vehicle.rotor.thrust_max * (f * u * u + (1.0 - f) * u)
        self.thrust = 0.8 * self.thrust + 0.2 * thrust  # the rotors' lag
        self.force = np.array([0.0, 0.0, self.thrust.sum() / vehicle.mass])
        self.v = self.v + h * (so3.matrix_from_quaternion(self.q) @ self.force - UP)
        self.w = self.w + h * (self.torques @ self.thrust) / INERTIA
        if self.p[2] <= 0.0 and self.v[2] <= 0.0:  # the ground holds the vehicle
            self.v, self.w, self.force = np.zeros(3), np.zeros(3), UP
        self.q = so3.quaternion_multiply(self.q, so3.quaternion_from_rotation_vector(h * self.w))
        self.p, self.tick = self.p + h * self.v, self.tick + 1

    def truth(self):
        chi = [*self.p, *so3.euler_from_quaternion(self.q), *self.arm]
        state = np.array([chi, [*self.v, *self.w, *self.still], np.zeros_like(chi)])
        payload = np.full(3, np.nan), np.full(4, np.nan)
        return Truth(state, self.q, *payload, 0.0, 0.0, np.zeros_like(self.thrust), self.thrust)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    engine, scene = sys.argv[1:3]
    out = Path(sys.argv[3]) if len(sys.argv) > 3 else new_folder(Path("results"), "own_simulator")
    with Flight(plant="own_simulator:OwnSimulator", engine=engine, scenario=scene, out=out) as own:
        print(own.wait().metrics["rms"])
