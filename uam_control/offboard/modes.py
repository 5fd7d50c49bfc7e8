"""PX4's flight modes in MAVLink's encoding, command results, severities and command ids."""

from __future__ import annotations

from enum import Enum, IntEnum

from uam_control.settings.plain_members import plain_members


@plain_members
class Mode(Enum):
    """PX4's flight modes; value: (main mode, sub mode)."""

    MANUAL = (1, 0)
    ALTITUDE = (2, 0)
    POSITION = (3, 0)
    ORBIT = (3, 1)
    POSITION_SLOW = (3, 2)
    TAKEOFF = (4, 2)
    HOLD = (4, 3)
    MISSION = (4, 4)
    RETURN = (4, 5)
    LAND = (4, 6)  # also PX4's failsafe mode Descend
    FOLLOW = (4, 8)
    PRECISION_LAND = (4, 9)
    VTOL_TAKEOFF = (4, 10)
    EXTERNAL1 = (4, 11)  # modes that other programs register
    EXTERNAL2 = (4, 12)
    EXTERNAL3 = (4, 13)
    EXTERNAL4 = (4, 14)
    EXTERNAL5 = (4, 15)
    EXTERNAL6 = (4, 16)
    EXTERNAL7 = (4, 17)
    EXTERNAL8 = (4, 18)
    GUIDED_COURSE = (4, 19)
    ACRO = (5, 0)
    OFFBOARD = (6, 0)
    STABILIZED = (7, 0)
    TERMINATION = (10, 0)  # the motors stand for good
    ALTITUDE_CRUISE = (11, 0)
    UNKNOWN = (0, 0)

    @property
    def lands(self) -> bool:
        """Whether the mode brings the vehicle to the ground by itself."""
        return self in (Mode.LAND, Mode.RETURN, Mode.PRECISION_LAND)

    @property
    def custom_mode(self) -> int:
        """Return HEARTBEAT.custom_mode: main mode in bits 16..23, sub mode in bits 24..31."""
        main, sub = self.value
        return main << 16 | sub << 24

    @classmethod
    def from_custom_mode(cls, custom_mode: int) -> Mode:
        """Return the mode of a HEARTBEAT.custom_mode; UNKNOWN for others."""
        try:
            return cls((custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF))
        except ValueError:
            return cls.UNKNOWN


@plain_members
class MavResult(IntEnum):
    """MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4
    IN_PROGRESS = 5


def result_word(result: int) -> str:
    """Return the name of a MAV_RESULT in lower case."""
    try:
        return MavResult(result).name.lower().replace("_", " ")
    except ValueError:
        return f"result {result}"


@plain_members
class Severity(IntEnum):
    """MAV_SEVERITY: the values in use."""

    EMERGENCY = 0
    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    INFO = 6


@plain_members
class MavCmd(IntEnum):
    """MAV_CMD: the values in use."""

    DO_SET_MODE = 176
    DO_FLIGHTTERMINATION = 185
    DO_SET_ACTUATOR = 187
    DO_GRIPPER = 211
    ARM_DISARM = 400
    RUN_PREARM_CHECKS = 401
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512


FORCE = 21196  # second parameter of ARM_DISARM: skip the checks
CUSTOM_MODE_ENABLED = 1  # MAV_MODE_FLAG in the first parameter of DO_SET_MODE
