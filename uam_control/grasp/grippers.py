"""What each kind of gripper itself tells about a payload: its own evidence beside pose and mass."""

from __future__ import annotations

import math
from typing import Protocol

from uam_control.grasp.evidence import Evidence
from uam_control.grasp.grasp_parameters import GraspParameters
from uam_control.grasp.sight import Sight
from uam_control.vehicle.gripper import MAGNET, NO_GRIPPER, TWO_FINGER

SLACK = 0.1  # of the stroke, within which the fingers are at an end
PRESSED = 0.5  # of the force limit: the fingers press on something


class GripperKind(Protocol):
    """One kind. `early`: it may act before the contact."""

    early: bool

    def held(self, sight: Sight, p: GraspParameters) -> Evidence:
        """Return whether it holds something, as far as it feels it; "" without a measurement."""

    def let_go(self, sight: Sight, p: GraspParameters) -> bool:
        """Return whether it has let go what it held, as far as it feels it."""


class Insensible:
    """A gripper without a measurement of its own: an electromagnet, a suction cup."""

    early = True

    def held(self, sight: Sight, p: GraspParameters) -> Evidence:
        """See `GripperKind`."""
        return Evidence(None, "")

    def let_go(self, sight: Sight, p: GraspParameters) -> bool:
        """See `GripperKind`."""
        return False


class Fingers:
    """Two fingers that report opening and force: closed without resistance, they hold nothing."""

    early = False

    def held(self, sight: Sight, p: GraspParameters) -> Evidence:
        """See `GripperKind`."""
        if math.isnan(sight.opening):
            return Evidence(None, "fingers not measured")
        text = f"fingers {1e3 * sight.opening:.0f} mm open, {sight.squeeze:.1f} N"
        if self._part(sight, p) <= SLACK:
            return Evidence(False, text)
        return Evidence(True if sight.squeeze >= PRESSED * p.gripper_force else None, text)

    def let_go(self, sight: Sight, p: GraspParameters) -> bool:
        """See `GripperKind`."""
        return self._part(sight, p) >= 1.0 - SLACK

    @staticmethod
    def _part(sight: Sight, p: GraspParameters) -> float:
        """Return the part of the stroke by which they are open, 0..1."""
        closed, opened = p.gripper_opening
        return (sight.opening - closed) / (opened - closed)


GRIPPERS: dict[str, GripperKind] = {
    NO_GRIPPER: Insensible(),
    MAGNET: Insensible(),
    TWO_FINGER: Fingers(),
}
