"""Faults that are put into a flight on purpose: what there is, when they come, what they do."""

from uam_sim_bridge.faults.catalogue import FAULTS
from uam_sim_bridge.faults.fault import LINK, PLANT, PROCESS, Fault, FaultError
from uam_sim_bridge.faults.schedule import Schedule, TimedFault, read_schedule

__all__ = [
    "FAULTS",
    "LINK",
    "PLANT",
    "PROCESS",
    "Fault",
    "FaultError",
    "Schedule",
    "TimedFault",
    "read_schedule",
]
