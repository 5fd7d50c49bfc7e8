"""Faults of cables, devices and wiring. They need the devices of a rehearsal: `uam rehearse`.

Each acts itself on `lab`, a `laboratory.Laboratory`, or as a mistake of its set-up.
"""

import math
from dataclasses import replace
from typing import Any, ClassVar

from uam_control.settings.parameter_set import integer, number
from uam_sim_bridge.faults.fault import CABLE, Fault

JOINT = "joint number"
NORMAL_TEMPERATURE = 35.0  # [deg C]


class CableFault(Fault):
    """A fault of the laboratory."""

    PLACE: ClassVar[str] = CABLE

    def pull(self, lab: Any, on: bool) -> None:
        """Begin the fault, or end it."""

    def last(self, lab: Any) -> None:
        """Go on with the fault, at each tick from its begin to its end."""

    def mount(self, servos: list[Any]) -> None:
        """Make the mistake in the servos (`chain.ServoDescription`), joints base to tip."""

    def set_up(self, bodies: list[Any]) -> None:
        """Make the mistake in the tracked bodies (`set_up.RoomBody`), the vehicle's first."""


class JointFault(CableFault):
    """A fault of a joint's servo."""

    joint: int = integer(1, JOINT, 1, 7)

    @property
    def index(self) -> int:
        """Place of the servo in the chain, from 0."""
        return self.joint - 1


class BusUnplugged(CableFault):
    """The USB adapter of the servo bus is pulled; the servos keep their supply."""

    def pull(self, lab: Any, on: bool) -> None:
        (lab.bus.unplug if on else lab.bus.plug_in)()


class ServoUnplugged(JointFault):
    """The cable to a servo is pulled; it and those behind it have no supply."""

    joint: int = integer(2, JOINT, 1, 7)

    def pull(self, lab: Any, on: bool) -> None:
        before = [one.id for one in lab.servos][: self.index]
        if on:
            lab.bus.line.cut_behind(before[-1] if before else 0)
        else:
            lab.bus.line.mend()


class BusBitErrors(CableFault):
    """Single bits on the servo bus are wrong, in both directions."""

    rate: float = number(1e-4, "fraction of wrong bits", "1", 0.0, 0.1)

    def pull(self, lab: Any, on: bool) -> None:
        lab.bus.line.bit_error_rate = self.rate if on else 0.0


class ServoOverheating(JointFault):
    """A servo becomes hot; beyond its own limit of 80 degrees it stops by itself."""

    rate: float = number(10.0, "rise of the temperature", "K/s", 0.1, 1000.0)
    highest: float = number(95.0, "final temperature", "deg C", 40.0, 150.0)

    def pull(self, lab: Any, on: bool) -> None:
        if not on:
            lab.servos[self.index].temperature = NORMAL_TEMPERATURE

    def last(self, lab: Any) -> None:
        servo, rise = lab.servos[self.index], self.rate * lab.plant.period
        servo.temperature = min(self.highest, servo.temperature + rise)


class ServoOverload(JointFault):
    """A servo reports the hardware error overload and stops by itself."""

    def pull(self, lab: Any, on: bool) -> None:
        if on:
            lab.servos[self.index].raise_error("overload")


class MocapUnplugged(CableFault):
    """The network cable of the motion capture is pulled."""

    def pull(self, lab: Any, on: bool) -> None:
        lab.mocap.unplug(on)
        lab.poses_come = not on


class MocapOccluded(CableFault):
    """The markers of the vehicle are hidden from the cameras."""

    def pull(self, lab: Any, on: bool) -> None:
        lab.mocap.occlude(lab.parameters.body, on)
        lab.poses_come = not on


class MocapRenamed(CableFault):
    """The vehicle's rigid body has another name in the motion capture."""

    def pull(self, lab: Any, on: bool) -> None:
        names = lab.parameters.body, f"{lab.parameters.body}_2"
        lab.mocap.rename(*(names if on else names[::-1]))
        lab.poses_come = not on


class MocapAxes(CableFault):
    """The motion capture streams with another upward axis than the calibration has."""

    def set_up(self, bodies: list[Any]) -> None:
        bodies[:] = [replace(one, other_axis=True) for one in bodies]


class MocapTurned(CableFault):
    """The rigid body was made with the vehicle's nose in another direction than the calibration
    has."""

    turn: float = number(90.0, "turn to the left", "deg", -180.0, 180.0)

    def set_up(self, bodies: list[Any]) -> None:
        bodies[0] = replace(bodies[0], turn=math.radians(self.turn))


class SerialUnplugged(CableFault):
    """The serial adapter to the autopilot is pulled."""

    def pull(self, lab: Any, on: bool) -> None:
        (lab.cable.unplug if on else lab.cable.plug_in)()


class SerialCut(CableFault):
    """The serial line to the autopilot is cut; the adapter stays."""

    def pull(self, lab: Any, on: bool) -> None:
        lab.cable.cut = on


class SerialBitErrors(CableFault):
    """Single bits on the serial line to the autopilot are wrong, in both directions."""

    rate: float = number(1e-4, "fraction of wrong bits", "1", 0.0, 0.1)

    def pull(self, lab: Any, on: bool) -> None:
        lab.cable.bit_error_rate = self.rate if on else 0.0


class MagnetUnplugged(CableFault):
    """The wire to the magnet is pulled: the magnet is off."""

    def pull(self, lab: Any, on: bool) -> None:
        lab.magnet_plugged = not on


class ImuUnplugged(CableFault):
    """The companion's own IMU is pulled (`imu: topic`)."""

    def pull(self, lab: Any, on: bool) -> None:
        lab.imu_plugged = not on


class HilUnplugged(CableFault):
    """The autopilot loses sensors and motors: in a rehearsal, its simulator link."""

    def pull(self, lab: Any, on: bool) -> None:
        lab.hil_plugged = not on


class WrongId(JointFault):
    """A servo has another id than the hardware file."""

    joint: int = integer(2, JOINT, 1, 7)
    id: int = integer(9, "its id", 0, 252)

    def mount(self, servos: list[Any]) -> None:
        servos[self.index] = replace(servos[self.index], id=self.id)


class JointsSwapped(JointFault):
    """The ids of two servos are swapped."""

    other: int = integer(2, "number of the other joint", 1, 7)

    def mount(self, servos: list[Any]) -> None:
        i, j = self.index, self.other - 1
        one, other = servos[i], servos[j]
        servos[i], servos[j] = replace(one, id=other.id), replace(other, id=one.id)


class DirectionReversed(JointFault):
    """A servo is mounted the other way round: its direction is reversed."""

    def mount(self, servos: list[Any]) -> None:
        one = servos[self.index]
        servos[self.index] = replace(one, direction=-one.direction)


class ZeroShifted(JointFault):
    """The horn of a servo is mounted at another angle."""

    turn: float = number(90.0, "angle of the horn", "deg", -180.0, 180.0)

    def mount(self, servos: list[Any]) -> None:
        one = servos[self.index]
        counts = round(self.turn / 360.0 * one.table.counts_per_turn)
        servos[self.index] = replace(one, zero=one.zero + one.direction * counts)


class MagnetInverted(CableFault):
    """The magnet is switched by the other level: on when it should be off."""
