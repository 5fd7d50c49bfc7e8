"""Faults of cables, devices and wiring. They need the devices of a rehearsal: `uam rehearse`."""

from typing import ClassVar

from uam_control.settings.parameter_set import number
from uam_sim_bridge.faults.fault import CABLE, Fault

JOINT = "joint number"


class CableFault(Fault):
    """A fault of the laboratory. WIRING: a mistake of the set-up, which acts from the start on."""

    PLACE: ClassVar[str] = CABLE
    WIRING: ClassVar[bool] = False


class BusUnplugged(CableFault):
    """The USB adapter of the servo bus is pulled; the servos keep their supply."""


class ServoUnplugged(CableFault):
    """The cable to a servo is pulled; it and those behind it have no supply."""

    joint: int = number(2, JOINT, "1", 1, 7)


class BusBitErrors(CableFault):
    """Single bits on the servo bus are wrong, in both directions."""

    rate: float = number(1e-4, "fraction of wrong bits", "1", 0.0, 0.1)


class ServoOverheating(CableFault):
    """A servo becomes hot; beyond its own limit of 80 degrees it stops by itself."""

    joint: int = number(1, JOINT, "1", 1, 7)
    rate: float = number(10.0, "rise of the temperature", "K/s", 0.1, 1000.0)
    highest: float = number(95.0, "final temperature", "deg C", 40.0, 150.0)


class ServoOverload(CableFault):
    """A servo reports the hardware error overload and stops by itself."""

    joint: int = number(1, JOINT, "1", 1, 7)


class MocapUnplugged(CableFault):
    """The network cable of the motion capture is pulled."""


class MocapOccluded(CableFault):
    """The markers of the vehicle are hidden from the cameras."""


class MocapRenamed(CableFault):
    """The vehicle's rigid body has another name in the motion capture."""


class MocapAxes(CableFault):
    """The motion capture streams with another upward axis than the calibration has."""

    WIRING: ClassVar[bool] = True


class MocapTurned(CableFault):
    """The rigid body was made with the vehicle's nose in another direction than the calibration
    has."""

    WIRING: ClassVar[bool] = True
    turn: float = number(90.0, "turn to the left", "deg", -180.0, 180.0)


class SerialUnplugged(CableFault):
    """The serial adapter to the autopilot is pulled."""


class SerialCut(CableFault):
    """The serial line to the autopilot is cut; the adapter stays."""


class SerialBitErrors(CableFault):
    """Single bits on the serial line to the autopilot are wrong, in both directions."""

    rate: float = number(1e-4, "fraction of wrong bits", "1", 0.0, 0.1)


class MagnetUnplugged(CableFault):
    """The wire to the magnet is pulled: the magnet is off."""


class ImuUnplugged(CableFault):
    """The companion's own IMU is pulled (`imu: topic`)."""


class HilUnplugged(CableFault):
    """The autopilot loses sensors and motors: in a rehearsal, its simulator link."""


class WrongId(CableFault):
    """A servo has another id than the hardware file."""

    WIRING: ClassVar[bool] = True
    joint: int = number(2, JOINT, "1", 1, 7)
    id: int = number(9, "its id", "1", 0, 252)


class JointsSwapped(CableFault):
    """The ids of two servos are swapped."""

    WIRING: ClassVar[bool] = True
    joint: int = number(1, JOINT, "1", 1, 7)
    other: int = number(2, "number of the other joint", "1", 1, 7)


class DirectionReversed(CableFault):
    """A servo is mounted the other way round: its direction is reversed."""

    WIRING: ClassVar[bool] = True
    joint: int = number(1, JOINT, "1", 1, 7)


class ZeroShifted(CableFault):
    """The horn of a servo is mounted at another angle."""

    WIRING: ClassVar[bool] = True
    joint: int = number(1, JOINT, "1", 1, 7)
    turn: float = number(90.0, "angle of the horn", "deg", -180.0, 180.0)


class MagnetInverted(CableFault):
    """The magnet is switched by the other level: on when it should be off."""

    WIRING: ClassVar[bool] = True
