"""What a design begins with: inertias over the poses of the arm, torques, lags and noise."""

import itertools
import math
from dataclasses import dataclass
from typing import Self

import mujoco
import numpy as np

from uam_control.coordinates import ARM, ATTITUDE, POSITION
from uam_control.vehicle import VehicleDescription
from uam_control.vehicle.rotor_geometry import YAW, effectiveness, torque_scale
from uam_lab.analysis.dynamics import Body
from uam_sim_bridge.autopilot.loops.rate_control import (
    LIMIT,
    TORQUE,
    D,
    P,
    filter_coefficients,
    filter_gyro,
    rate_torque,
)
from uam_sim_bridge.autopilot.params import DEFINITIONS
from uam_sim_bridge.plant import Vehicle

HELD = 0.5  # periods: a command acts for one period, on the average half of one late
IMPULSE = 400  # samples of the filters' response to one sample of noise
FILTERS = ("IMU_GYRO_CUTOFF", "IMU_DGYRO_CUTOFF", "MC_YAW_TQ_CUTOFF")


@dataclass(frozen=True)
class Facts:
    """Numbers of a vehicle."""

    inertia: np.ndarray  # (3,) [kg m^2] roll, pitch, yaw; arm locked, the middle over the poses
    joints: np.ndarray  # (n,) [kg m^2] of each joint, the middle over the poses
    poses: dict[str, tuple[float, ...]]  # joint angles (n,) [rad] by their names
    torque: np.ndarray  # (3,) [N m] largest in hover
    scale: np.ndarray  # (3,) [N m] of a normalised torque of 1
    lag: np.ndarray  # (3,) [s] of rotors and filters of the torque
    dead: float  # [s] dead time of the rate loop
    slope: float  # [s] dead time of its path of D in addition
    noise: np.ndarray  # (3, 2, 2) P, D → variance of the command
    seen: float  # [s] age of a state at the law
    bus: float  # [s] age of a joint's sample when its torque acts
    servo: np.ndarray  # (n,) [N m] torque at which the supervisor holds

    @classmethod
    def of(cls, vehicle: Vehicle) -> Self:
        """Return the facts of a vehicle; raises VehicleError if its MJCF contradicts it."""
        described, period = vehicle.description, vehicle.description.control_period
        sensors, servos = vehicle.numbers["sensors"], vehicle.numbers["servos"]
        inertia, joints, poses = inertias(vehicle)
        cutoffs = [
            described.autopilot_gains.get(name, DEFINITIONS[name].default) for name in FILTERS
        ]
        gyro, slope, yaw = (1.0 / (2.0 * math.pi * one) if one > 0.0 else 0.0 for one in cutoffs)
        imu, bus = sensors["imu"], sensors["joints"]["latency_ticks"]
        return cls(
            inertia=inertia,
            joints=joints,
            poses=poses,
            torque=largest_torque(described),
            scale=torque_scale(*described.geometry(), described.rotor_thrust),
            lag=described.rotor.lag + np.array([0.0, 0.0, yaw]),
            dead=math.sqrt(2.0) * gyro + HELD * period,
            slope=slope,
            noise=imu["gyro_noise"] ** 2 * noise_gains(1.0 / period, cutoffs),
            seen=(imu["latency_ticks"] + HELD) * period,
            bus=(bus + servos["command_latency_ticks"] + HELD) * period,
            servo=np.array([one.effort_limit for one in described.servos]),
        )


def inertias(vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray, dict[str, tuple[float, ...]]]:
    """Return `Facts.inertia`, `Facts.joints`, `Facts.poses` over the corners of the arm's range."""
    described, body = vehicle.description, Body(vehicle)
    ranges = ({j.low, min(max(0.0, j.low), j.high), j.high, j.stowed} for j in described.joints)
    corners = sorted(itertools.product(*ranges))
    rows = np.array([inertia_at(body, one) for one in corners])
    middle = 0.5 * (rows.min(axis=0) + rows.max(axis=0))
    size = rows[:, : ATTITUDE.stop - ATTITUDE.start].sum(axis=1)
    poses = {
        "stowed": described.stowed,
        "least inertia": corners[int(np.argmin(size))],
        "most inertia": corners[int(np.argmax(size))],
    }
    return middle[:3], middle[3:], poses


def inertia_at(body: Body, arm: tuple[float, ...]) -> np.ndarray:
    """Return the inertia about roll, pitch, yaw of the locked vehicle about its centre of mass, and
    that of each joint with the base held (3 + n,) [kg m^2]; arm (n,) [rad]."""
    chi = np.zeros(body.size)
    chi[ARM] = arm
    mass = body.mass(chi)[: body.size, : body.size]
    across = mass[ATTITUDE, POSITION] @ np.linalg.solve(
        mass[POSITION, POSITION], mass[POSITION, ATTITUDE]
    )
    return np.concatenate([np.diag(mass[ATTITUDE, ATTITUDE] - across), np.diag(mass)[ARM]])


def standing_torque(
    vehicle: Vehicle, arm: tuple[float, ...], payload_mass: float = 0.0
) -> np.ndarray:
    """Return the torque (3,) [N m] about roll, pitch, yaw with which rotors of different thrust
    hold the vehicle level; arm (n,) [rad]; payload_mass [kg], in the hand."""
    body, described = Body(vehicle, payload_mass), vehicle.description
    chi = np.zeros(body.size)
    chi[ARM] = arm
    body.place(chi)
    mujoco.mj_kinematics(body.model, body.data)
    mujoco.mj_comPos(body.model, body.data)
    base = body.model.body("base").id
    centre = body.data.subtree_com[base] - body.data.xpos[base]
    middle = np.mean([rotor.position for rotor in described.rotors], axis=0)
    weight = (described.mass + payload_mass) * described.gravity
    return np.cross(centre - middle, [0.0, 0.0, weight])


def largest_torque(described: VehicleDescription) -> np.ndarray:
    """Return the torque (3,) [N m] about each axis at which, in hover, the first rotor is at 0 or
    at its full thrust."""
    by_torque = np.linalg.pinv(effectiveness(*described.geometry()))[:, : YAW + 1]
    hover = described.mass * described.gravity / len(described.rotors)
    room = min(hover, described.rotor.thrust_max - hover)
    return room / np.abs(by_torque).max(axis=0)


def noise_gains(rate: float, cutoffs: list[float]) -> np.ndarray:
    """Return (3, 2, 2): with g = (P, D) of an axis, g^T N g is the variance of its normalised
    torque for gyroscope noise of variance 1 at `rate` [Hz]; cutoffs [Hz]: of FILTERS."""
    filters, still = filter_coefficients(rate, *cutoffs), np.zeros(3)
    answers = np.zeros((2, IMPULSE, 3))
    for which, row in enumerate((P, D)):
        memory, gains = np.zeros((7, 3)), np.zeros((LIMIT + 1, 3))
        gains[row] = 1.0
        for k in range(IMPULSE):
            filter_gyro(np.full(3, float(k == 0)), 1.0 / rate, filters, memory)
            rate_torque(still, 1.0 / rate, filters, gains, True, memory)
            answers[which, k] = memory[TORQUE]
    return np.einsum("aki,bki->iab", answers, answers)
