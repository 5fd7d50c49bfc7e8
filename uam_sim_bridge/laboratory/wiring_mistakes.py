"""Mistakes of the set-up: servos mounted otherwise than described, cameras set up otherwise."""

from collections.abc import Sequence

from uam_sim_bridge.devices.dynamixel.chain import ArmChain, ServoDescription
from uam_sim_bridge.faults.fault import FaultError
from uam_sim_bridge.faults.schedule import Schedule
from uam_sim_bridge.laboratory.tracked_room import RoomBody


def mistaken_chain(chain: ArmChain, mistakes: Schedule) -> tuple[ServoDescription, ...]:
    """Return the servos as mounted, in the order of the joints. Raises FaultError."""
    servos = list(chain.servos)
    for fault in (one.fault for one in mistakes.faults):
        joint = max(fault.values.get(name, 0) for name in ("joint", "other"))
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
