"""Fault injection: the faults, their schedule, and their effects on plant, link and processes."""

from uam_sim_bridge.faults.fault import CABLE, LINK, PLANT, PROCESS, Fault, FaultError
from uam_sim_bridge.faults.fault_catalogue import FAULTS
from uam_sim_bridge.faults.schedule import Schedule, TimedFault, read_schedule
