"""Rotor geometry → torques and thrust, normalised as in PX4's control allocator.

The mixer is the pseudo-inverse of the rotors' effectiveness. Its columns are scaled, which makes it
independent of the size of vehicle and rotors (PX4: pseudo-inverse, normalised roll, pitch, yaw):
roll and pitch by the same factor to the norm sqrt(n/2) for n rotors; yaw to a largest entry of 1;
thrust to a mean entry of 1.
"""

import math

import numpy as np

ROLL, PITCH, YAW, THRUST = range(4)
USUAL_COEFFICIENT = 6.5  # PX4's default of CA_ROTORn_CT
AUTHORITY = 0.1  # twice the coefficient times lever up to which PX4 leaves an axis out


def thrust_coefficient(moment_ratio: float) -> float:
    """Return CA_ROTORn_CT of rotors with this reaction torque per newton [m].

    PX4 does not control an axis on which no rotor has more than 0.05 (ControlAllocator.cpp), and
    scales the coefficient out otherwise: it is its default, or what gives yaw AUTHORITY.
    """
    return max(USUAL_COEFFICIENT, AUTHORITY / moment_ratio)


def effectiveness(px: np.ndarray, py: np.ndarray, moment_ratio: np.ndarray) -> np.ndarray:
    """Return (4, n): rows roll, pitch, yaw torque [N m] and thrust [N] per newton of each rotor.

    px, py (n,) [m]: rotor positions forward and right; moment_ratio (n,) [m]: reaction torque per
    newton, positive for a counter-clockwise rotor seen from above (CA_ROTORn_PX, _PY, _KM).
    """
    return np.stack([-np.asarray(py), np.asarray(px), np.asarray(moment_ratio), np.ones(len(px))])


def normalised_mixer(px: np.ndarray, py: np.ndarray, moment_ratio: np.ndarray) -> np.ndarray:
    """Return (n, 4): motor thrust 0..1 per unit of normalised roll, pitch, yaw, thrust.

    px, py, moment_ratio (n,): see `effectiveness`. Raises ValueError where the rotors cannot make
    roll, pitch, yaw and thrust independently.
    """
    matrix = effectiveness(px, py, moment_ratio)
    if np.linalg.matrix_rank(matrix) < 4:
        raise ValueError("the rotor geometry cannot make roll, pitch, yaw and thrust independently")
    mixer = np.linalg.pinv(matrix)
    used = np.count_nonzero(np.abs(mixer) > 1e-3, axis=0)
    norms = np.linalg.norm(mixer, axis=0)
    mixer[:, :YAW] /= max(norms[axis] / math.sqrt(used[axis] / 2.0) for axis in (ROLL, PITCH))
    mixer[:, YAW] /= mixer[:, YAW].max()
    mixer[:, THRUST] /= np.abs(mixer[:, THRUST]).mean()
    mixer[np.abs(mixer) < 1e-3] = 0.0
    return np.ascontiguousarray(mixer)


def torque_scale(
    px: np.ndarray, py: np.ndarray, moment_ratio: np.ndarray, rotor_thrust: float
) -> np.ndarray:
    """Return (3,) [N m]: the torque about each axis for a normalised torque of 1.

    px, py, moment_ratio (n,): see `effectiveness`; rotor_thrust [N]: thrust of one rotor at motor
    thrust 1.
    """
    matrix = effectiveness(px, py, moment_ratio)
    return rotor_thrust * np.diag(matrix @ normalised_mixer(px, py, moment_ratio))[:3].copy()
