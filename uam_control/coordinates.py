"""The generalised coordinates chi = [p, q, alpha] and where each lies in an array.

A state or reference is a float64 array of shape (3, 6 + n) for an arm of n joints: the rows are
chi, chi_dot and chi_ddot.

- chi[POSITION]: position in the world frame (ENU) [m]
- chi[ATTITUDE]: roll, pitch, yaw (Z-Y-X Euler angles of the body, FLU) [rad]
- chi[ARM]: joint angles, 0 = link straight down, positive swings forward [rad]

chi_dot[ATTITUDE] holds the body rates and chi_ddot[ATTITUDE] their derivative (quasi-velocities in
FLU), which is what Lee's error e_Omega and a gyroscope use; for level attitude they equal the Euler
rates. chi_ddot[POSITION] is the acceleration in the world frame, gravity removed.

Compiled functions use the numbers, as state[CHI, ROLL]; numba takes them as constants.
"""

from __future__ import annotations

CHI, CHI_DOT, CHI_DDOT = range(3)  # rows
X, Y, Z, ROLL, PITCH, YAW, ALPHA = range(7)  # columns; ALPHA: the first joint
POSITION = slice(X, ROLL)
ATTITUDE = slice(ROLL, ALPHA)
ARM = slice(ALPHA, None)
BASE_COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")


def arm_coordinates(joints: int) -> tuple[str, ...]:
    """Names of the arm's coordinates: alpha_1 .. alpha_n."""
    return tuple(f"alpha_{i}" for i in range(1, joints + 1))


def coordinates(joints: int) -> tuple[str, ...]:
    """Names of the entries of chi for an arm of `joints` joints."""
    return (*BASE_COORDINATES, *arm_coordinates(joints))
