"""The generalised coordinates chi = [p, q, alpha] of eq. (1), EL_dynamics, and their array indices.

A state or reference is a float64 array of shape (3, 6 + n) for an arm of n joints. The rows are
chi, chi_dot and chi_ddot; the columns are:

- chi[POSITION]: position in the world frame (ENU) [m]
- chi[ATTITUDE]: roll, pitch, yaw (Z-Y-X Euler angles of the body, FLU) [rad]
- chi[ARM]: joint angles, zeros and signs as in the MJCF; of the S-500's arm 0 = link straight
  down, positive swings forward [rad]

chi_dot[ATTITUDE] contains the body rates [rad/s] and chi_ddot[ATTITUDE] their derivative [rad/s^2]
(quasi-velocities in FLU). A gyroscope measures these, and Lee's error e_Omega uses them. In level
attitude they equal the Euler rates. chi_ddot[POSITION] is the acceleration in the world frame
[m/s^2], gravity removed.

A motion is a planned reference with two more rows, (5, 6 + n): jerk and snap, the third and fourth
derivatives. The base's desired attitude, body rates and their derivatives follow from them
(`mission/motion/flatness.py`).

Compiled functions use the indices, for example state[CHI, ROLL]; numba compiles them as constants.
"""

CHI, CHI_DOT, CHI_DDOT = range(3)  # rows
JERK, SNAP = 3, 4  # further rows of a motion
MOTION_ROWS = 5
X, Y, Z, ROLL, PITCH, YAW, ALPHA = range(7)  # columns; ALPHA: the first joint
POSITION = slice(X, ROLL)
ATTITUDE = slice(ROLL, ALPHA)
ARM = slice(ALPHA, None)
ANGLES = slice(ROLL, None)  # attitude and arm
BASE_COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")


def arm_coordinates(joints: int) -> tuple[str, ...]:
    """Return the names of the arm's coordinates: alpha_1 .. alpha_n."""
    return tuple(f"alpha_{i}" for i in range(1, joints + 1))


def coordinates(joints: int) -> tuple[str, ...]:
    """Return the names of the entries of chi for an arm of `joints` joints."""
    return (*BASE_COORDINATES, *arm_coordinates(joints))
