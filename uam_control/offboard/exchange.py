"""What the offboard sequence and the autopilot say to each other: requests, and the report."""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

from uam_control.offboard.firmware import Firmware
from uam_control.offboard.modes import FORCE, MavCmd, Mode
from uam_control.settings.plain_members import plain_members


@plain_members
class Request(Enum):
    """A request to the autopilot; the value is the text for logs."""

    OFFBOARD = "OFFBOARD"
    ARM = "arming"
    DISARM = "disarming"
    KILL = "stopping the motors"


def commands_of(spoken: Firmware) -> dict[Request, tuple[MavCmd, tuple[float, ...]]]:
    """Return the requests as COMMAND_LONG: command, first parameters."""
    return {
        Request.OFFBOARD: (MavCmd.DO_SET_MODE, spoken.mode_request(Mode.OFFBOARD)),
        Request.ARM: (MavCmd.ARM_DISARM, (1.0, 0.0)),
        Request.DISARM: (MavCmd.ARM_DISARM, (0.0, 0.0)),
        Request.KILL: (MavCmd.ARM_DISARM, (0.0, FORCE)),
    }


class Reported(NamedTuple):
    """The autopilot's state as last received.

    connected: the last heartbeat is recent. intended: the mode that was chosen last by a person or
    a companion (CURRENT_MODE.intended_custom_mode), UNKNOWN without that message. failsafe: the
    autopilot flies its own failsafe (HEARTBEAT.system_status CRITICAL). delivered [s]: when the
    newest message was sent that certainly arrived. killed: the kill switch or flight termination
    holds the motors (HEARTBEAT.system_status FLIGHT_TERMINATION).
    """

    connected: bool
    armed: bool
    mode: Mode
    intended: Mode = Mode.UNKNOWN
    failsafe: bool = False
    delivered: float = math.inf
    killed: bool = False
