"""The direct engine: the objects of the nodes in one loop, without middleware and sockets.

One pass of the loop is one control tick, in the order of a lockstep flight with ROS: sensors, the
stages of `ControlTick`, autopilot, physics. Most passes are steady ticks, see `steady`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from uam_control.mission import Mission, Scenario
from uam_control.mission.time_limit import DISARMED, Settled, time_limit
from uam_control.offboard.sequence import OffboardParameters, OffboardSequence
from uam_control.profiles.profile import Profile, servo_mode
from uam_control.stages.bridge_stage import BridgeSets, BridgeStage
from uam_control.stages.control_tick import ControlTick, Imu, Joints, Pose
from uam_control.stages.timing import Timing
from uam_control.stamps import SECOND, nanoseconds
from uam_lab.flights.direct.record import TickRecorder
from uam_lab.flights.direct.steady.places import AUTOPILOT, BLIND
from uam_lab.records.results.timeseries import SUBSYSTEMS, FlightTable, columns_of, gain_columns
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.joined import JoinedAutopilot
from uam_sim_bridge.autopilot.params import Parameters
from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.faults.direct import DirectFaults
from uam_sim_bridge.faults.faulty_plant import make_plant
from uam_sim_bridge.nodes.bridge_parameters import check_names
from uam_sim_bridge.plant import PhysicsError, Samples, Vehicle
from uam_sim_bridge.plant.effects.network_delay import SetpointDelay
from uam_sim_bridge.plant.engines import DEFAULT_PLANT
from uam_sim_bridge.plant.plant import check_arrays

if TYPE_CHECKING:
    from uam_lab.flights.direct.steady.ticks import SteadyTicks

LONGEST_WAIT = 20.0  # [s] simulated, for the autopilot to get ready and armed
STILL = 1.0  # [s] without a state, from which on the reason of an end names it


class DirectFlight:
    """One flight in the direct engine; `recording` fills while it flies.

    `mission.output` is its result. `say`: called with what takes long, a text.
    """

    def __init__(
        self,
        scenario: Scenario,
        profile: Profile,
        vehicle: Vehicle,
        payload_mass: float,
        seed: int,
        faults: Schedule | None = None,
        plant: str = DEFAULT_PLANT,
        autopilot_imu: bool = False,
    ) -> None:
        """payload_mass [kg]; faults: those that `faults.feasibility.check` lets pass; plant: see
        `plant_class`; autopilot_imu: the estimator has the autopilot's IMU, a tick late."""
        self.autopilot_imu = autopilot_imu
        self.say: Callable[[str], object] = lambda text: None
        sets = profile.sets
        vehicle = vehicle.changed(servo_mode(profile))
        started = (vehicle, payload_mass, seed, scenario.arm_start)
        self.plant = make_plant(*started, faults or Schedule(), plant)
        self._faults = DirectFaults(faults, self.plant) if faults else None
        described, section = vehicle.description, profile.section("mavlink_bridge")
        check_names(profile)
        self.sequence = OffboardSequence(OffboardParameters.among(section))
        stand_in = Autopilot(Parameters.of(described), spoken=self.sequence.firmware)
        self.autopilot = JoinedAutopilot(stand_in, self.sequence)
        bridge = BridgeStage(
            BridgeSets.of(described, section), described, self.autopilot, self.sequence
        )
        timing = Timing(self.plant.period)
        self.control = ControlTick(scenario, sets, bridge, timing, described)
        if self._faults:
            self.autopilot.passes = self._faults.link.passes
            self.autopilot.receives = self._faults.link.receives
            self.autopilot.late_to = self._faults.link.late_to
            self.autopilot.late_from = self._faults.link.late_from
            self.control.insert("bridge", "faults", self._update_faults)
        if network := SetpointDelay.of(vehicle.numbers["effects"], seed):
            usual, signals = self.autopilot.late_to, self.control.signals
            self.autopilot.late_to = lambda: usual() + network.at(signals.stamp / SECOND)
        self.ended_by = ""  # reason of an end before that of the mission
        self._limit = time_limit(scenario, sets["mission"])
        self._complete = False  # every kind of sensor has delivered
        laws, columns = self.control.laws, columns_of(described)
        length = scenario.landing.end + 12.0
        self.recording = FlightTable(int(length / self.plant.period), columns)
        controllers = {name: laws[name].controller for name in SUBSYSTEMS}
        self.recorder = TickRecorder(
            self.recording,
            self.plant.truth_row,
            [one.adaptation for one in controllers.values()],
            [gain_columns(name, one.names, columns) for name, one in controllers.items()],
            self.plant.period,
        )

    def run(self, progress: Callable[[float, str], None] | None = None) -> FlightTable:
        """Fly until mission and vehicle are at their end.

        progress(mission time [s], phase): called once a second.
        """
        plant, output = self.plant, self.mission.output
        ticks_a_second, settled = round(1.0 / plant.period), Settled()
        while not (output.done and settled.after_mission(plant.time, self.armed)):
            second = plant.tick // ticks_a_second
            left = int((self._limit - plant.time) / plant.period)
            try:
                self.advance((second + 1) * ticks_a_second - plant.tick, left)
            except PhysicsError as error:
                self.ended_by = str(error)
                break
            if plant.tick // ticks_a_second > second:
                if progress is not None:
                    progress(output.time, output.phase)
                if settled.over(plant.time, self.armed):
                    silent = plant.time - self.control.mission.ahead / SECOND
                    lost = f"no state of the estimator for {silent:.1f} s: IMU lost? "
                    self.ended_by = (lost if silent > STILL else "") + DISARMED
                    break
            if output.time < 0.0 and plant.time > LONGEST_WAIT:
                reasons = "; ".join(self.sequence.reasons) or "no reason"
                not_armed = f"the autopilot did not arm: {reasons}"
                against = self.mission.beyond or self.mission.not_ready or not_armed
                self.mission.give_up(plant.time, against)
            if plant.time >= self._limit:
                self.ended_by = f"time limit of {self._limit:g} s"
                break
        return self.recording

    @property
    def mission(self) -> Mission:
        """The mission of the flight."""
        return self.control.mission.mission

    @property
    def armed(self) -> bool:
        """Whether the autopilot is armed."""
        return self.autopilot.autopilot.commander.armed

    @property
    def fault_records(self) -> list[dict[str, Any]]:
        """The injected faults; see `faults.timeline.record`."""
        return self._faults.records if self._faults else []

    @cached_property
    def steady(self) -> SteadyTicks:
        """The steady ticks of this flight."""
        # here: a flight with nodes imports this module, and compiles none of it
        from uam_lab.flights.direct.steady.ticks import SteadyTicks

        return SteadyTicks(self)

    def advance(self, enough: int, most: int) -> None:
        """Fly at least one tick, and until `enough` are flown; at most `most`, which is not less.

        After `enough` it ends where it costs no time. Raises PhysicsError.
        """
        if not self.steady.fly(min(enough, most), most):
            self.tick()

    def tick(self) -> None:
        """One control period of the whole vehicle."""
        plant, control = self.plant, self.control
        now, magnet = plant.time, control.signals.magnet
        samples = plant.observe(self.recorder.truth())
        self.autopilot.time = now
        self._record(now, magnet, control.tick(*self.delivered(samples)))
        self._end_tick(samples.hil)

    def finish(self, stage: int, hil: tuple[float, np.ndarray, np.ndarray]) -> None:
        """Finish a tick that steady ticks have begun; stage: the first one that is left.

        See `steady.places`; hil: as in `Samples`.
        """
        control, now, magnet = self.control, self.plant.time, self.control.signals.magnet
        if stage == BLIND:
            self._record(now, magnet, False)
        elif stage < AUTOPILOT:
            self._record(now, magnet, control.go_on(stage))
        self._end_tick(hil)

    def _record(self, now: float, magnet: bool, whole: bool) -> None:
        """Record the tick of `now` [s]; magnet: in force at its begin; whole: see `write`."""
        control, motors, recorder = self.control, self.autopilot.motors, self.recorder
        if whole:
            recorder.write(now, motors, magnet, control.signals, control.bridge.sent)
        else:
            recorder.write_blind(now, motors, magnet, self.mission.output.phase)

    def _end_tick(self, hil: tuple[float, np.ndarray, np.ndarray]) -> None:
        signals = self.control.signals
        motors = self.autopilot.update(*hil)
        self.plant.step(motors, signals.arm_command, signals.magnet)

    def delivered(
        self, samples: Samples
    ) -> tuple[Pose | None, Joints | None, Imu | None, Pose | None]:
        """What the stages get of `samples`, with stamps [ns].

        As the plant's node does, nothing is delivered before every kind of sensor has.
        """
        mocap, joints, payload = samples.mocap, samples.joints, samples.payload
        imu = self.autopilot.imu() if self.autopilot_imu else samples.imu
        if not self._complete:
            self._complete = None not in (mocap, joints, imu)
            for sample in filter(None, (mocap, joints, imu, samples.hil)):
                check_arrays(sample[1:])
            if not self._complete:
                return None, None, None, None
        return (
            mocap and (nanoseconds(mocap[0]), mocap[1], mocap[2]),
            joints and (nanoseconds(joints[0]), joints[1], joints[2], joints[3]),
            imu and (nanoseconds(imu[0]), imu[1], imu[2]),
            payload and (nanoseconds(payload[0]), payload[1], payload[2]),
        )

    def _update_faults(self, control: ControlTick) -> bool:
        """Stage of a flight with faults: give plant and link the mission time and the phase."""
        signals = control.signals
        self._faults.update(signals.stamp / SECOND, signals.time, signals.phase)
        return True
