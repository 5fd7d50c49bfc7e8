"""Pulls the cables of a laboratory at their times, and plugs them in again."""

from uam_sim_bridge.faults import cable_faults as kinds
from uam_sim_bridge.faults.cable_faults import CableFault
from uam_sim_bridge.faults.schedule import Schedule
from uam_sim_bridge.faults.timeline import FaultState, Timeline
from uam_sim_bridge.laboratory.laboratory import Laboratory

NORMAL_TEMPERATURE = 35.0  # [deg C]


class Cables:
    """The faults of a rehearsal after its start; call `update` at each tick.

    `imu_plugged`: whether the companion's own IMU is there; `poses_come`: whether another's driver
    of the motion capture has poses.
    """

    def __init__(self, laboratory: Laboratory, schedule: Schedule) -> None:
        """schedule: faults of cables; mistakes of the set-up are the laboratory's."""
        self._lab = laboratory
        self.timeline = Timeline(schedule)
        self.imu_plugged = self.poses_come = True
        self._hot: dict[int, kinds.ServoOverheating] = {}  # by number of the joint, from 0

    def update(self, stamp: float) -> list[FaultState]:
        """Advance to `stamp` [s], the plant's time; return the faults that began or ended."""
        changed = self.timeline.update(stamp)
        for one in changed:
            if not one.fault.WIRING:
                getattr(self, f"_{one.fault.NAME}")(one.fault, one.active)
        for joint, fault in self._hot.items():
            servo = self._lab.servos[joint]
            rise = fault.rate * self._lab.plant.period
            servo.temperature = min(fault.highest, servo.temperature + rise)
        return changed

    def _bus_unplugged(self, fault: CableFault, on: bool) -> None:
        (self._lab.bus.unplug if on else self._lab.bus.plug_in)()

    def _servo_unplugged(self, fault: kinds.ServoUnplugged, on: bool) -> None:
        line = self._lab.bus.line
        if not on:
            line.mend()
            return
        before = [one.id for one in self._lab.servos][: int(fault.joint) - 1]
        line.cut_behind(before[-1] if before else 0)

    def _bus_bit_errors(self, fault: kinds.BusBitErrors, on: bool) -> None:
        self._lab.bus.line.faults.bit_error_rate = fault.rate if on else 0.0

    def _servo_overheating(self, fault: kinds.ServoOverheating, on: bool) -> None:
        joint = int(fault.joint) - 1
        if on:
            self._hot[joint] = fault
        else:
            del self._hot[joint]
            self._lab.servos[joint].temperature = NORMAL_TEMPERATURE

    def _servo_overload(self, fault: kinds.ServoOverload, on: bool) -> None:
        if on:
            self._lab.servos[int(fault.joint) - 1].raise_error("overload")

    def _mocap_unplugged(self, fault: CableFault, on: bool) -> None:
        self._lab.mocap.unplug(on)
        self.poses_come = not on

    def _mocap_occluded(self, fault: CableFault, on: bool) -> None:
        self._lab.mocap.occlude(self._lab.parameters.body, on)
        self.poses_come = not on

    def _mocap_renamed(self, fault: CableFault, on: bool) -> None:
        body = self._lab.parameters.body
        names = body, f"{body}_2"
        self._lab.mocap.rename(*(names if on else names[::-1]))
        self.poses_come = not on

    def _serial_unplugged(self, fault: CableFault, on: bool) -> None:
        (self._lab.cable.unplug if on else self._lab.cable.plug_in)()

    def _serial_cut(self, fault: CableFault, on: bool) -> None:
        self._lab.cable.cut = on

    def _serial_bit_errors(self, fault: kinds.SerialBitErrors, on: bool) -> None:
        self._lab.cable.bit_error_rate = fault.rate if on else 0.0

    def _magnet_unplugged(self, fault: CableFault, on: bool) -> None:
        self._lab.magnet_plugged = not on

    def _imu_unplugged(self, fault: CableFault, on: bool) -> None:
        self.imu_plugged = not on

    def _hil_unplugged(self, fault: CableFault, on: bool) -> None:
        self._lab.hil_plugged = not on
