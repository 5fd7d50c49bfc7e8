"""The end effector of a flight: commanded and asked where it is."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from uam_lab.flights.operator import Operator

if TYPE_CHECKING:
    from geometry_msgs.msg import PoseStamped

    from uam_lab.flights.library.commands import Commands


class Hand:
    """Commands as those of `Flight`; each raises CommandRefused with the reason."""

    def __init__(self, commands: Callable[[], Commands]) -> None:
        self._commands = commands

    def goto(self, x: float, y: float, z: float, yaw: float | None = None) -> str:
        """Bring the hand to a position [m, ENU] and hold it there; yaw [rad]: heading, None: as it
        is. Returns the answer."""
        return self._commands().goto(x, y, z, yaw, hand=True)

    def plan(self, message: Any) -> str:
        """Fly a PoseStamped, a MultiDOFJointTrajectory or a TwistStamped of the hand."""
        return self._commands().plan(message, hand=True)

    @property
    def pose(self) -> PoseStamped:
        """The estimate of the hand's pose in the world."""
        return self._commands().call(Operator.hand_pose)
