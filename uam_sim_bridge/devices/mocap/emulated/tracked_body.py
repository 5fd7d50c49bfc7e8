"""A rigid body as a tracking system sees it: pose of the vehicle → pose of its markers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uam_control.maths.rotations import matrix_from_quaternion, quaternion_multiply

# ENU → the tracker's axes, rows: Y up has x, up, and -north
AXES = {
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "z": np.eye(3),
}
_TURNS = {"y": np.array([0.5**0.5, -(0.5**0.5), 0.0, 0.0]), "z": np.array([1.0, 0.0, 0.0, 0.0])}


@dataclass
class TrackedBody:
    """A body of the server.

    up: the tracker's upward axis; made_at (4,) [w x y z]: attitude FLU → ENU of the vehicle when
    the rigid body was made, along whose axes at that time it lies; pivot (3,) [m, FLU]: its pivot,
    from base_link.
    """

    name: str
    up: str = "y"
    made_at: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    pivot: tuple[float, ...] = (0.0, 0.0, 0.0)

    def seen(
        self, position: np.ndarray, quaternion: np.ndarray
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return position x y z [m] and rotation x y z w in the tracker's axes.

        position (3,) [m, ENU] and quaternion (4,) [w x y z], FLU → ENU, of base_link. The rotation
        is that since the body was made, in the tracker's axes.
        """
        marked = position + matrix_from_quaternion(quaternion) @ np.array(self.pivot)
        turn = _TURNS[self.up]
        since = quaternion_multiply(quaternion, _inverse(np.array(self.made_at)))
        turned = quaternion_multiply(quaternion_multiply(turn, since), _inverse(turn))
        return tuple(AXES[self.up] @ marked), (*turned[1:], turned[0])


def _inverse(quaternion: np.ndarray) -> np.ndarray:
    return quaternion * np.array([1.0, -1.0, -1.0, -1.0])
