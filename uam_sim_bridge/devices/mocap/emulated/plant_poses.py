"""Poses of a physics engine for the emulated server: `server.expose(host, poses_of(truth))`."""

from __future__ import annotations

import numpy as np

from uam_control.coordinates import CHI, POSITION
from uam_control.maths.rotations import matrix_from_quaternion
from uam_sim_bridge.plant.plant import Truth

VEHICLE, PAYLOAD = "uam", "payload"


def poses_of(truth: Truth, payload_top: float = 0.0) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return name → (position (3,) [m, ENU], quaternion (4,) FLU → ENU) of vehicle and payload.

    payload_top [m]: from the payload's centre to the middle of its upper side, which is its pose.
    """
    up = matrix_from_quaternion(truth.payload_quaternion)[:, 2]
    return {
        VEHICLE: (truth.state[CHI, POSITION].copy(), truth.quaternion.copy()),
        PAYLOAD: (truth.payload_position + payload_top * up, truth.payload_quaternion.copy()),
    }
