"""What the offboard sequence and the autopilot say to each other: requests, report, reasons."""

import math
from enum import Enum
from typing import NamedTuple

from uam_control.offboard.firmware import Firmware
from uam_control.offboard.modes import FORCE, MavCmd, Mode
from uam_control.settings.plain_members import plain_members

KEPT = 5


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
    """The autopilot's state as last received."""

    connected: bool  # the last heartbeat is recent
    armed: bool
    mode: Mode
    intended: Mode = Mode.UNKNOWN  # chosen last: CURRENT_MODE.intended_custom_mode, if it comes
    failsafe: bool = False  # it flies its own: HEARTBEAT.system_status CRITICAL
    delivered: float = math.inf  # [s] when the newest message was sent that surely arrived
    killed: bool = False  # by switch or termination: system_status FLIGHT_TERMINATION


class Reasons:
    """`told`: the reasons, newest last. Some texts of the firmware pass by themselves."""

    def __init__(self, spoken: Firmware) -> None:
        """spoken: whose texts they are."""
        self._firmware = spoken
        self.told: tuple[str, ...] = ()
        self._passing: dict[str, float] = {}  # reason that may pass → [s] since when

    def add(self, text: str) -> None:
        """Add a reason; one that was there becomes the newest."""
        text = self._firmware.with_advice(text)
        others = tuple(reason for reason in self.told if reason != text)
        self.told = (*others, text)[-KEPT:]

    def add_lasting(self, text: str, time: float, streaming: bool, delay: float) -> None:
        """Add a reason at `time` [s]; one that may pass only if it has lasted for `delay` [s].

        streaming: setpoints are streamed for long enough.
        """
        if self._firmware.passing(text, streaming):
            since = self._passing.setdefault(text, time)
            if time - since < delay:
                return
        self.add(text)

    def add_all(self) -> None:
        """Add also those that might have passed."""
        for earlier in self._passing:
            self.add(earlier)
        self._passing.clear()

    def forget(self) -> None:
        """Discard all: their cause is over."""
        self.told = ()
        self._passing.clear()
