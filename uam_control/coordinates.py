"""The generalised coordinates chi = [p, q, alpha] and where each lies in an array.

A state or reference is a float64 array of shape (3, 8): the rows are chi, chi_dot and chi_ddot.

- chi[0:3]: position in the world frame (ENU) [m]
- chi[3:6]: roll, pitch, yaw (Z-Y-X Euler angles of the body, FLU) [rad]
- chi[6:8]: joint angles, 0 = link straight down, positive swings forward [rad]

chi_dot[3:6] holds the body rates and chi_ddot[3:6] their derivative (quasi-velocities in FLU),
which is what Lee's error e_Omega and a gyroscope use; for level attitude they equal the Euler
rates. chi_ddot[0:3] is the acceleration in the world frame, gravity removed.
"""

from __future__ import annotations

COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw", "alpha_1", "alpha_2")
POSITION = slice(0, 3)
ATTITUDE = slice(3, 6)
ARM = slice(6, 8)
YAW = COORDINATES.index("yaw")
SIZE = len(COORDINATES)
JOINTS = COORDINATES[ARM]
