"""The set-up of servos and cameras, with its mistakes.

What the cameras see of a body, for any calibration, is the inverse of the driver's conversion:

    R_tr = R_wtᵀ R_wb R_rbᵀ        p_t = R_wtᵀ (p_b + origin + R_wb pivot)

w world, t tracker, b base_link, r rigid body; see `devices.mocap.calibration`. A wrong set-up shows
something else: another upward axis, or a rigid body made with another heading.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uam_control.maths.rotations import (
    matrix_from_quaternion,
    quaternion_from_euler,
    quaternion_multiply,
)
from uam_sim_bridge.devices.dynamixel.chain import ArmChain, ServoDescription
from uam_sim_bridge.devices.mocap.calibration import UPRIGHT, Calibration, conjugate
from uam_sim_bridge.faults.fault import FaultError
from uam_sim_bridge.faults.schedule import Schedule


@dataclass
class RoomBody:
    """A rigid body of the server."""

    name: str
    calibration: Calibration
    other_axis: bool = False  # streamed with the other upward axis
    turn: float = 0.0  # [rad] nose so far to the left of the calibration's when the body was made

    def seen(
        self, position: np.ndarray, quaternion: np.ndarray
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """See `mocap_server.Body`: as streamed."""
        c = self.calibration
        back = conjugate(c.world)
        pivot = matrix_from_quaternion(quaternion) @ np.array(c.pivot)
        at = matrix_from_quaternion(back) @ (position + np.array(c.origin) + pivot)
        turned = quaternion_multiply(
            back, quaternion_multiply(quaternion, conjugate(np.array(c.body)))
        )
        if self.turn:
            made = quaternion_from_euler(np.array([0.0, 0.0, self.turn]))
            made = quaternion_multiply(back, quaternion_multiply(made, c.world))
            turned = quaternion_multiply(turned, conjugate(made))
        if self.other_axis:
            other = UPRIGHT["y"] if c.up == "y" else conjugate(UPRIGHT["y"])
            at = matrix_from_quaternion(other) @ at
            turned = quaternion_multiply(other, quaternion_multiply(turned, conjugate(other)))
        return tuple(at.tolist()), (*turned[1:].tolist(), float(turned[0]))


def mistaken_chain(chain: ArmChain, mistakes: Schedule) -> tuple[ServoDescription, ...]:
    """Return the servos as mounted, in the order of the joints. Raises FaultError."""
    servos = list(chain.servos)
    for fault in (one.fault for one in mistakes.faults):
        joint = max(fault.to_mapping().get(name, 0) for name in ("joint", "other"))
        if joint > len(servos):
            raise FaultError(f"{fault.NAME}: joint {joint:g}: the vehicle has {len(servos)}")
        fault.mount(servos)
    return tuple(servos)


def mistaken_room(bodies: Sequence[RoomBody], mistakes: Schedule) -> list[RoomBody]:
    """Return the bodies, the vehicle's first, as the cameras stream them."""
    found = list(bodies)
    for one in mistakes.faults:
        one.fault.set_up(found)
    return found
