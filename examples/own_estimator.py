"""Your own estimator: IMU integrated, pulled to the poses; no delay, no bias, no gate.

python examples/own_estimator.py [FOLDER]
"""

import sys
from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import ALPHA, ROLL
from uam_control.estimation.base import BaseParameters, Estimator
from uam_control.estimation.catalogue import ESTIMATORS
from uam_control.maths import rotations as so3
from uam_control.settings.parameter_set import choice, number
from uam_lab import Flight


@dataclass(frozen=True)
class PulledParameters(BaseParameters):
    estimator: str = choice("pulled", "the estimator that flies, fixed", ("pulled",), fixed=True)
    bandwidth: float = number(12.0, "correction by the poses", "rad/s", 0.5, 60.0)


class PulledEstimator(Estimator):
    kind = PulledParameters

    def __init__(self, parameters, joints):
        self.state, self.filter = np.zeros((3, ALPHA + joints)), 0.1
        self.set_parameters(parameters)
        self.forget()

    def forget(self):
        self.q, self.posed, self.sampled, self.complete = None, None, None, False

    def mocap(self, stamp, position, quaternion):
        chi, chi_dot, _ = self.state
        if self.q is None:
            self.q, chi[:ROLL], chi_dot[:ROLL] = quaternion.copy(), position, 0.0
        else:
            error, w = position - chi[:ROLL], self.parameters.bandwidth
            dt = min(stamp - self.posed, 0.1)
            chi[:ROLL] += 2.0 * w * dt * error
            chi_dot[:ROLL] += w * w * dt * error
            self.q += w * dt * (np.copysign(1.0, self.q @ quaternion) * quaternion - self.q)
            self.q /= np.linalg.norm(self.q)
        self.posed = stamp

    def imu(self, stamp, gyro, force):
        dt, self.sampled = stamp - (self.sampled or stamp), stamp
        if self.q is None or not 0.0 < dt < 0.1:
            return
        chi, chi_dot, chi_ddot = self.state
        turn = so3.quaternion_from_rotation_vector(dt * gyro)
        self.q = so3.quaternion_multiply(self.q, turn)
        pull = np.array([0.0, 0.0, self.parameters.gravity])
        acceleration = so3.matrix_from_quaternion(self.q) @ force - pull
        alpha = (gyro - chi_dot[ROLL:ALPHA]) / dt
        chi_ddot[:ROLL] += self.filter * (acceleration - chi_ddot[:ROLL])
        chi_ddot[ROLL:ALPHA] += self.filter * (alpha - chi_ddot[ROLL:ALPHA])
        chi_dot[:ROLL] += dt * acceleration
        chi_dot[ROLL:ALPHA] = gyro
        chi[:ROLL] += dt * chi_dot[:ROLL]
        chi[ROLL:ALPHA] = so3.euler_from_quaternion(self.q)
        self.complete = True

    def joints(self, stamp, alpha, alpha_dot):
        self.state[0, ALPHA:], self.state[1, ALPHA:] = alpha, alpha_dot

    def update(self):
        return self.state


if __name__ == "__main__":
    ESTIMATORS["pulled"] = PulledEstimator
    options = {"out": sys.argv[1]} if len(sys.argv) > 1 else {}
    mine = {"state_estimator": {"estimator": "pulled", "bandwidth": 10.0}}
    with Flight(scenario="hover", engine="direct", parameters=mine, **options) as one:
        print("rms [m]:", *one.wait().metrics["rms"]["position_m"])
