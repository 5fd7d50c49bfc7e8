"""Checks whether engine, processes and machine allow the faults of a flight."""

from collections.abc import Collection, Mapping, Sequence

from uam_control.vehicle import VehicleDescription, load_description
from uam_sim_bridge.faults.fault import CABLE, PROCESS, Fault, FaultError
from uam_sim_bridge.faults.link_faults import LinkFault, MavlinkDelay
from uam_sim_bridge.faults.process_faults import ProcessFault
from uam_sim_bridge.faults.schedule import Schedule

REHEARSAL = "rehearsal"  # an engine, beside ros and direct


def check(
    schedule: Schedule,
    engine: str,
    absent: Collection[str] = (),
    refused: Mapping[str, str] | None = None,
    vehicle: VehicleDescription | None = None,
) -> None:
    """Raise FaultError for the first fault that is not possible in this flight.

    engine: ros, direct or REHEARSAL; absent: processes that the flight does not start itself;
    refused: fault name → reason why this machine does not allow it, "" if it does.
    """
    for one in schedule.faults:
        fault = one.fault
        for what, parts in parts_of(vehicle or load_description()).items():
            if getattr(fault, what, 1) > len(parts):
                raise FaultError(
                    f"{fault.NAME}: {what} {getattr(fault, what):g}: the vehicle has {len(parts)}"
                )
        if fault.PLACE == CABLE and engine != REHEARSAL:
            raise FaultError(f"{fault.NAME}: only a rehearsal has cables: uam rehearse --cable")
        why = needs_nodes(fault) if engine == "direct" else ""
        if why:
            raise FaultError(f"{fault.NAME}: {why}: needs --engine ros")
        if why := (refused or {}).get(fault.NAME):
            raise FaultError(f"{fault.NAME}: not on this machine: {why}")
        if isinstance(fault, ProcessFault) and fault.node in absent:
            raise FaultError(f"{fault.NAME}: this flight does not start {fault.node}")


def parts_of(vehicle: VehicleDescription) -> dict[str, Sequence[object]]:
    """Return what the parameters of faults count, by the parameter's name."""
    return {"motor": vehicle.rotors, "joint": vehicle.joints}


def needs_nodes(fault: Fault) -> str:
    """Return the reason why the direct engine cannot inject this fault; "" if it can."""
    if fault.PLACE == PROCESS:
        return "the direct engine has no processes"
    if isinstance(fault, LinkFault) and not (fault.outwards or isinstance(fault, MavlinkDelay)):
        return "the direct engine has no MAVLink connection from the autopilot"
    return ""
