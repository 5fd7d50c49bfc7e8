"""Mistakes of the set-up: servos mounted otherwise than described, cameras set up otherwise."""

import math
from collections.abc import Sequence
from dataclasses import replace

from uam_sim_bridge.devices.dynamixel.chain import ArmChain, ServoDescription
from uam_sim_bridge.faults.cable_faults import (
    DirectionReversed,
    JointsSwapped,
    MocapAxes,
    MocapTurned,
    WrongId,
    ZeroShifted,
)
from uam_sim_bridge.faults.fault import FaultError
from uam_sim_bridge.faults.schedule import Schedule
from uam_sim_bridge.laboratory.tracked_room import RoomBody


def mistaken_chain(chain: ArmChain, mistakes: Schedule) -> tuple[ServoDescription, ...]:
    """Return the servos as mounted, in the order of the joints. Raises FaultError."""
    servos = list(chain.servos)
    for fault in (one.fault for one in mistakes.faults):
        if isinstance(fault, WrongId):
            i = _index(fault.NAME, fault.joint, servos)
            servos[i] = replace(servos[i], id=int(fault.id))
        elif isinstance(fault, JointsSwapped):
            i, j = (_index(fault.NAME, one, servos) for one in (fault.joint, fault.other))
            ids = servos[i].id, servos[j].id
            servos[i], servos[j] = replace(servos[i], id=ids[1]), replace(servos[j], id=ids[0])
        elif isinstance(fault, DirectionReversed):
            i = _index(fault.NAME, fault.joint, servos)
            servos[i] = replace(servos[i], direction=-servos[i].direction)
        elif isinstance(fault, ZeroShifted):
            i = _index(fault.NAME, fault.joint, servos)
            counts = round(fault.turn / 360.0 * servos[i].table.counts_per_turn)
            servos[i] = replace(servos[i], zero=servos[i].zero + servos[i].direction * counts)
    return tuple(servos)


def mistaken_room(bodies: Sequence[RoomBody], mistakes: Schedule) -> list[RoomBody]:
    """Return the bodies, the vehicle's first, as the cameras stream them."""
    found = list(bodies)
    for fault in (one.fault for one in mistakes.faults):
        if isinstance(fault, MocapAxes):
            found = [replace(one, other_axis=True) for one in found]
        elif isinstance(fault, MocapTurned):
            found[0] = replace(found[0], turn=math.radians(fault.turn))
    return found


def _index(name: str, joint: float, servos: Sequence[ServoDescription]) -> int:
    if joint > len(servos):
        raise FaultError(f"{name}: joint {joint:g}: the vehicle has {len(servos)}")
    return int(joint) - 1
