"""Rotations: Z-Y-X Euler angles, matrices and quaternions [w x y z].

All rotate from the body frame (FLU) to the world frame (ENU), unless a docstring says otherwise.
The paper's R_B^W, eq. (3), rot_matrix, is `matrix_from_euler`.
"""

import math

import numpy as np

from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.vectors import Rows

CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])  # times a unit quaternion: its inverse


@borrowing
def rows_from_euler(roll: float, pitch: float, yaw: float) -> Rows:
    """Return the rows of R_B^W, eq. (3), rot_matrix, of three angles [rad]."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, sr * cp, cp * cr),
    )


@jit
def matrix_from_euler(euler: np.ndarray) -> np.ndarray:
    """Return R_B^W (3, 3), see `rows_from_euler`, of roll, pitch, yaw [rad] in `euler` (3,)."""
    matrix = np.empty((3, 3))
    for i, row in enumerate(rows_from_euler(euler[0], euler[1], euler[2])):
        matrix[i, 0], matrix[i, 1], matrix[i, 2] = row
    return matrix


@borrowing
def thrust_attitude(force: np.ndarray, yaw: float) -> tuple[float, float]:
    """Return roll and pitch [rad] at yaw [rad] whose body z axis is along force (3,) [N, world].

    Eq. (4a), pos: the third column of eq. (3), rot_matrix, along the force, solved for the angles.
    """
    x, y, z = force[0], force[1], force[2]
    cy, sy = math.cos(yaw), math.sin(yaw)
    size = max(math.sqrt(x**2 + y**2 + z**2), 1e-9)
    roll = math.asin(max(-1.0, min(1.0, (sy * x - cy * y) / size)))
    return roll, math.atan2(cy * x + sy * y, z)


@borrowing
def body_rates(
    roll: float, pitch: float, roll_rate: float, pitch_rate: float, yaw_rate: float
) -> tuple[float, float, float]:
    """Return the body rates [rad/s, FLU] of Z-Y-X Euler angles [rad] and their rates [rad/s]."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    about_y = cr * pitch_rate + sr * cp * yaw_rate
    return roll_rate - sp * yaw_rate, about_y, -sr * pitch_rate + cr * cp * yaw_rate


@jit
def rotate(matrix: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return matrix (3, 3) times v (3,), of any unit; for R_B^W: body → world."""
    out = np.empty(3)
    for i in range(3):
        out[i] = matrix[i, 0] * v[0] + matrix[i, 1] * v[1] + matrix[i, 2] * v[2]
    return out


@jit
def rotate_back(matrix: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the transpose of matrix (3, 3) times v (3,), of any unit; for R_B^W: world → body."""
    out = np.empty(3)
    for i in range(3):
        out[i] = matrix[0, i] * v[0] + matrix[1, i] * v[1] + matrix[2, i] * v[2]
    return out


@jit
def matrix_from_quaternion(q: np.ndarray) -> np.ndarray:
    """Return R (3, 3) of the unit quaternion q (4,) = [w x y z]."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    matrix = np.empty((3, 3))
    matrix[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    matrix[0, 1] = 2.0 * (x * y - w * z)
    matrix[0, 2] = 2.0 * (x * z + w * y)
    matrix[1, 0] = 2.0 * (x * y + w * z)
    matrix[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    matrix[1, 2] = 2.0 * (y * z - w * x)
    matrix[2, 0] = 2.0 * (x * z - w * y)
    matrix[2, 1] = 2.0 * (y * z + w * x)
    matrix[2, 2] = 1.0 - 2.0 * (x * x + y * y)
    return matrix


def quaternion_from_matrix(matrix: np.ndarray) -> np.ndarray:
    """Return the unit quaternion q (4,) = [w x y z], w >= 0, of R (3, 3)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = matrix
    symmetric = [
        [xx + yy + zz, zy - yz, xz - zx, yx - xy],
        [zy - yz, xx - yy - zz, xy + yx, xz + zx],
        [xz - zx, xy + yx, yy - xx - zz, yz + zy],
        [yx - xy, xz + zx, yz + zy, zz - xx - yy],
    ]
    q = np.linalg.eigh(symmetric)[1][:, -1]  # Bar-Itzhack 2000: of its largest eigenvalue
    return -q if q[0] < 0.0 else q


@jit
def euler_from_quaternion(q: np.ndarray) -> np.ndarray:
    """Return roll, pitch, yaw (3,) [rad] of the unit quaternion q (4,); |pitch| <= pi/2."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    euler = np.empty(3)
    euler[0] = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    euler[1] = math.asin(min(1.0, max(-1.0, 2.0 * (w * y - x * z))))
    euler[2] = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return euler


@jit
def quaternion_from_euler(euler: np.ndarray) -> np.ndarray:
    """Return the unit quaternion (4,) [w x y z] of roll, pitch, yaw (3,) [rad]; w >= 0."""
    cr, sr = math.cos(euler[0] / 2.0), math.sin(euler[0] / 2.0)
    cp, sp = math.cos(euler[1] / 2.0), math.sin(euler[1] / 2.0)
    cy, sy = math.cos(euler[2] / 2.0), math.sin(euler[2] / 2.0)
    q = np.empty(4)
    q[0] = cr * cp * cy + sr * sp * sy
    q[1] = sr * cp * cy - cr * sp * sy
    q[2] = cr * sp * cy + sr * cp * sy
    q[3] = cr * cp * sy - sr * sp * cy
    if q[0] < 0.0:
        q *= -1.0
    return q


@jit
def quaternion_multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the Hamilton product a ⊗ b (4,) of two quaternions (4,) [w x y z]: b first, then a."""
    q = np.empty(4)
    q[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    q[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    q[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    q[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
    return q


@jit
def quaternion_from_rotation_vector(v: np.ndarray) -> np.ndarray:
    """Return the unit quaternion (4,) of the rotation vector v (3,) [rad] (exponential map).

    The rotation goes from the rotated to the original frame; v is the same in both.
    """
    angle = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    q = np.empty(4)
    # sin(a/2)/a; for small a its series, to avoid the division
    scale = 0.5 - angle * angle / 48.0 if angle < 1e-4 else math.sin(angle / 2.0) / angle
    q[0] = math.cos(angle / 2.0)
    q[1] = scale * v[0]
    q[2] = scale * v[1]
    q[3] = scale * v[2]
    return q


@jit
def rotation_error(reference: np.ndarray, actual: np.ndarray) -> np.ndarray:
    """Return the rotation vector (3,) [rad] from `actual` to `reference`, in the actual body frame.

    Both are unit quaternions (4,) [w x y z]. The length is 2 sin(angle/2): equal to the angle for
    small angles, and monotone up to pi.
    """
    difference = quaternion_multiply(CONJUGATE * actual, reference)
    sign = 2.0 if difference[0] >= 0.0 else -2.0
    return sign * difference[1:4]


def wrap_angle(angle: float | np.ndarray) -> float | np.ndarray:
    """Return `angle` [rad] (number or array of any shape) wrapped to [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


wrapped = jit(wrap_angle)  # the same for compiled functions


@borrowing
def tilt(euler: np.ndarray) -> float:
    """Return the angle [rad] between body z and world z; euler (3,): roll, pitch, yaw [rad]."""
    return math.acos(math.cos(euler[0]) * math.cos(euler[1]))
