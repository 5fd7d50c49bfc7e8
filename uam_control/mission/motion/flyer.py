"""What the pose of a hand depends on beside the reference: the arm, and the base's attitude."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.arm.chain import Chain
from uam_control.coordinates import ATTITUDE, CHI, CHI_DDOT, CHI_DOT, POSITION, YAW, Z
from uam_control.mission.motion.flatness import attitudes
from uam_control.vehicle import VehicleDescription, VehicleError, chain_and_hinge


class Flyer(NamedTuple):
    """gravity [m/s^2]; drag (3,): linear, per mass, along the world axes [1/s]; hinge: lowest and
    highest angle [rad] of the one that the hand hangs on."""

    chain: Chain
    gravity: float
    drag: np.ndarray
    hinge: tuple[float, float] = (-math.inf, math.inf)

    @classmethod
    def of(cls, vehicle: VehicleDescription) -> Flyer:
        """Return that of a vehicle. Raises VehicleError, also for one without an end effector."""
        chain, hinge = chain_and_hinge(vehicle)
        if not chain.has_hand:
            raise VehicleError(f"{vehicle.file}: the vehicle has no end effector")
        drag = np.array(vehicle.numbers["air"]["drag"]) / vehicle.mass
        return cls(chain, vehicle.gravity, drag, hinge)

    @classmethod
    def with_hand(cls, vehicle: VehicleDescription) -> Flyer | None:
        """Return that of a vehicle, None for one without an end effector."""
        try:
            return cls.of(vehicle)
        except VehicleError:
            return None


def flattened(rows: np.ndarray, flyer: Flyer) -> np.ndarray:
    """Write the attitude that the acceleration of rows (3, m, 6 + n) needs into their angles.

    Return the force (m, 3) of the rotors per mass [m/s^2].
    """
    force = rows[CHI_DDOT, :, POSITION] + flyer.drag * rows[CHI_DOT, :, POSITION]
    force[:, Z] += flyer.gravity
    rows[CHI, :, ATTITUDE] = attitudes(force, rows[CHI, :, YAW])
    return force
