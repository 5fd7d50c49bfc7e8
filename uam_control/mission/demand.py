"""What a reference needs of a vehicle, and what of it exceeds a limit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from uam_control.arm.chain import Chain, carrying
from uam_control.arm.kinematics import vehicle_dynamics
from uam_control.coordinates import ALPHA, ARM, CHI, CHI_DDOT, CHI_DOT, POSITION, ROLL, YAW, X, Z
from uam_control.maths.compiled import jit
from uam_control.maths.rotations import body_rates, matrix_from_euler
from uam_control.maths.vectors import rows as matrix_rows
from uam_control.maths.vectors import transposed, turned, vector
from uam_control.mission.motion.flatness import attitudes
from uam_control.mission.motion.trajectory import Trajectory, reference_rows
from uam_control.vehicle import VehicleDescription, VehicleError, chain_and_hinge

STEP = 0.01  # [s] between two times
TURN = 2  # steps to both sides, over which a change of the body rates counts: the rate loop's lag
STILL = 5e-7  # [rad/s] of a joint without friction


class Excess(NamedTuple):
    """A quantity beyond its limit."""

    quantity: str
    value: float  # the worst
    limit: float
    unit: str
    time: float  # [s] of the worst
    first: float  # [s] where it begins
    origin: str = ""  # of a limit that is in no parameter, in words
    ramp: str = ""  # the run-up or run-out it is in

    @property
    def beyond(self) -> float:
        """The distance from the limit."""
        return abs(self.value - self.limit)

    @property
    def text(self) -> str:
        """The excess in words."""
        beyond = "exceeds" if self.value > self.limit else "is below"
        limit = f"{self.limit:.3g} {self.unit}" + (f", {self.origin}," if self.origin else "")
        ramp = f"{self.ramp}: " if self.ramp else ""
        return (
            f"{ramp}{self.quantity} {self.value:.3g} {self.unit} {beyond} {limit} "
            f"at {self.time:.1f} s (from {self.first:.1f} s on)"
        )


class Demand(NamedTuple):
    """What a reference needs."""

    times: np.ndarray  # (m,) [s] of mission time
    position: np.ndarray  # (m, 3) [m]
    speed: np.ndarray  # (m,) [m/s]
    thrust: np.ndarray  # (m,) [N]
    tilt: np.ndarray  # (m,) [rad]
    body_rates: np.ndarray  # (m, 3) [rad/s, FLU]
    turn: np.ndarray  # (m,) [rad/s^2] change of those of roll and pitch
    angles: np.ndarray  # (m, n) [rad]
    joint_rates: np.ndarray  # (m, n) [rad/s]
    yaw_torque: np.ndarray  # (m,) [N m, FLU] of the rotors; NaN, as the next two: masses unknown
    joint_torques: np.ndarray  # (m, n) [N m]
    magnet_force: np.ndarray  # (m,) [N] the payload's apparent weight

    def within(self, part: slice | np.ndarray) -> Demand:
        """Return that of a part of the times."""
        return Demand(*(values[part] for values in self))


@dataclass(frozen=True)
class Needs:
    """What references need of a vehicle.

    The force follows from the acceleration, the weight and the drag; it points along the body's z
    axis, which with yaw gives the attitude; its derivative gives the body rates. The joint torques
    and the torque about yaw follow from the motion of all masses.
    """

    vehicle: VehicleDescription

    def along(self, trajectory: Trajectory, times: np.ndarray, carried: np.ndarray) -> Demand:
        """Return the demand of a reference at times (m,) [s], STEP apart; carried (m,) [kg]."""
        rows = reference_rows(trajectory, times, len(self.vehicle.joints))
        velocity, acceleration = rows[CHI_DOT, :, POSITION], rows[CHI_DDOT, :, POSITION]
        mass = self.vehicle.mass + carried
        drag = np.array(self.vehicle.numbers["air"]["drag"])
        up = np.array([0.0, 0.0, self.vehicle.gravity])
        force = mass[:, None] * (acceleration + up) + drag * velocity
        angles, rotation = attitudes(force, rows[CHI, :, YAW]), np.empty((len(times), 3, 3))
        turning, rates = np.gradient(angles, times, axis=0), np.empty_like(angles)
        turning[:, 2] = rows[CHI_DOT, :, YAW]
        _turns(angles, turning, rates, rotation)
        thrust = np.linalg.norm(force, axis=1)
        return Demand(
            times,
            rows[CHI, :, POSITION],
            np.linalg.norm(velocity, axis=1),
            thrust,
            np.arccos(np.clip(force[:, Z] / np.maximum(thrust, 1e-9), -1.0, 1.0)),
            rates,
            _changes(rates[:, : YAW - ROLL]),
            rows[CHI, :, ARM],
            rows[CHI_DOT, :, ARM],
            *self._loads(rows, rotation, rates, carried),
        )

    def _loads(
        self, rows: np.ndarray, rotation: np.ndarray, rates: np.ndarray, carried: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return `Demand.yaw_torque`, `Demand.joint_torques` and `Demand.magnet_force`.

        rows (3, m, 6 + n): the reference; rotation (m, 3, 3), rates (m, 3) [rad/s]: of the base.
        """
        count, joints, (chain, _) = len(carried), rows.shape[2] - ALPHA, self.arm
        if chain is None:
            unknown = np.full(count, np.nan)
            return unknown, np.full((count, joints), np.nan), unknown
        turning, gravity = np.gradient(rates, STEP, axis=0), self.vehicle.gravity
        motion = np.ascontiguousarray(rows), rotation, rates, turning, gravity
        torques, push, pull = np.empty((count, joints)), np.empty((count, 3)), np.zeros(count)
        yaw = np.empty(count)
        _write_loads(chain, *motion, torques, push, yaw)
        for mass in np.unique(carried[carried > 0.0]):
            loaded, more, turns = (np.empty_like(one) for one in (torques, push, yaw))
            _write_loads(carrying(chain, mass), *motion, loaded, more, turns)
            at = carried == mass
            torques[at], yaw[at] = loaded[at], turns[at]
            pull[at] = np.linalg.norm(more - push, axis=1)[at]
        return yaw, torques, pull

    @cached_property
    def arm(self) -> tuple[Chain | None, tuple[float, float]]:
        """The arm, None for a vehicle of another physics engine than MuJoCo; lowest and highest
        angle [rad] of the hinge that the hand hangs on, if any."""
        try:
            return chain_and_hinge(self.vehicle)
        except VehicleError:
            return None, (-math.inf, math.inf)


def _changes(rates: np.ndarray) -> np.ndarray:
    """Return the larger change (m,) [rad/s^2] of rates (m, 2) [rad/s] STEP apart."""
    found = np.zeros(len(rates))
    apart = np.abs(rates[2 * TURN :] - rates[: -2 * TURN]).max(axis=1)
    found[TURN : TURN + len(apart)] = apart / (2 * TURN * STEP)
    return found


@jit
def _turns(
    angles: np.ndarray, turning: np.ndarray, rates: np.ndarray, rotations: np.ndarray
) -> None:
    """Write the body rates (m, 3) [rad/s, FLU] and rotations (m, 3, 3), body → world.

    angles, turning (m, 3): roll, pitch, yaw [rad] and their rates [rad/s].
    """
    for i in range(len(angles)):
        roll, pitch, one = angles[i, 0], angles[i, 1], turning[i]
        rates[i, 0], rates[i, 1], rates[i, 2] = body_rates(roll, pitch, one[0], one[1], one[2])
        rotations[i] = matrix_from_euler(angles[i])


@jit
def _write_loads(
    chain: Chain,
    rows: np.ndarray,
    rotation: np.ndarray,
    rates: np.ndarray,
    turning: np.ndarray,
    gravity: float,
    torques: np.ndarray,
    push: np.ndarray,
    yaw: np.ndarray,
) -> None:
    """Write the joint torques (m, n) [N m] with friction, the force (m, 3) [N] and the torque about
    yaw (m,) [N m] that act on the vehicle, both FLU.

    See `Needs._loads`; turning (m, 3) [rad/s^2]; gravity [m/s^2].
    """
    for k in range(len(torques)):
        acceleration = vector(rows[CHI_DDOT, k, X:ROLL])
        force = (acceleration[0], acceleration[1], acceleration[2] + gravity)
        force = turned(transposed(matrix_rows(rotation[k])), force)
        base = force, vector(rates[k]), vector(turning[k])
        found, moment = vehicle_dynamics(chain, rows[:, k, ALPHA:], *base, torques[k])
        push[k, 0], push[k, 1], push[k, 2] = found
        yaw[k] = moment[2]
        for i in range(torques.shape[1]):
            speed = rows[CHI_DOT, k, ALPHA + i]
            torques[k, i] += chain.damping[i] * speed
            if abs(speed) > STILL:
                torques[k, i] += math.copysign(chain.friction[i], speed)
