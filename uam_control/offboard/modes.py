"""Flight modes, command results, severities and command ids."""

from enum import Enum, IntEnum, auto

from uam_control.settings.plain_members import plain_members


@plain_members
class Mode(Enum):
    """Flight modes of an autopilot, by PX4's names; their numbers: see `Firmware`."""

    MANUAL = auto()
    ALTITUDE = auto()
    POSITION = auto()
    ORBIT = auto()
    POSITION_SLOW = auto()
    TAKEOFF = auto()
    HOLD = auto()
    MISSION = auto()
    RETURN = auto()
    LAND = auto()
    FOLLOW = auto()
    PRECISION_LAND = auto()
    VTOL_TAKEOFF = auto()
    EXTERNAL1 = auto()
    EXTERNAL2 = auto()
    EXTERNAL3 = auto()
    EXTERNAL4 = auto()
    EXTERNAL5 = auto()
    EXTERNAL6 = auto()
    EXTERNAL7 = auto()
    EXTERNAL8 = auto()
    GUIDED_COURSE = auto()
    ACRO = auto()
    OFFBOARD = auto()
    STABILIZED = auto()
    TERMINATION = auto()
    ALTITUDE_CRUISE = auto()
    UNKNOWN = auto()

    @property
    def lands(self) -> bool:
        """Whether the mode brings the vehicle to the ground by itself."""
        return self in (Mode.LAND, Mode.RETURN, Mode.PRECISION_LAND)


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
