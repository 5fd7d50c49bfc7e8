"""The direct engine: the objects of the nodes in one loop, without middleware and sockets.

One pass of the loop is one control tick, in the order of a lockstep flight with ROS: sensors, the
stages of `ControlTick`, autopilot, physics. Most passes are compiled, see `compiled_ticks`.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from uam_control.coordinates import ARM, ATTITUDE, POSITION
from uam_control.maths.rotations import tilt, wrap_angle
from uam_control.mission import Mission, Scenario
from uam_control.mission.time_limit import DISARMED, Settled, time_limit
from uam_control.offboard.offboard_parameters import OffboardParameters
from uam_control.offboard.sequence import OffboardSequence
from uam_control.profiles.profile import Profile, servo_mode
from uam_control.stages.bridge_stage import BridgeSets, BridgeStage
from uam_control.stages.control_tick import ControlTick
from uam_control.stages.tick_stamps import Timing
from uam_control.stamps import SECOND, nanoseconds
from uam_lab.flights.direct.compiled_ticks import CompiledTicks
from uam_lab.flights.direct.record import TickRecorder
from uam_lab.flights.flight_settings import AUTOPILOT_IMU, FlightSettings
from uam_lab.flights.observer import FlightStatus, Observer
from uam_lab.flights.processes.interrupts import StopRequest
from uam_lab.records.results.outcome import Outcome, grasp_decisions, transitions
from uam_lab.records.results.result_folder import ResultFolder
from uam_lab.records.results.timeseries import FlightTable
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.joined import JoinedAutopilot
from uam_sim_bridge.autopilot.params import Parameters
from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.faults.faulty_plant import DirectFaults, make_plant
from uam_sim_bridge.nodes.bridge_parameters import check_names
from uam_sim_bridge.plant import PhysicsError, Samples, Vehicle
from uam_sim_bridge.plant.effects.network_delay import SetpointDelay
from uam_sim_bridge.plant.effects.pose_effects import OdometryDrift
from uam_sim_bridge.plant.plant import DEFAULT_PLANT, check_arrays

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
        vehicle = vehicle.changed(servo_mode(profile) | scenario.surroundings)
        started = (vehicle, payload_mass, seed, scenario.arm_start)
        self.plant = make_plant(*started, faults or Schedule(), plant)
        self._faults = DirectFaults(faults, self.plant) if faults else None
        described, section = vehicle.description, profile.section("mavlink_bridge")
        check_names(profile)
        self.sequence = OffboardSequence(OffboardParameters.among(section))
        stand_in = Autopilot(Parameters.of(described), spoken=self.sequence.firmware)
        network = SetpointDelay.of(vehicle.numbers["effects"], seed)
        self.autopilot = JoinedAutopilot(stand_in, self.sequence, network)
        bridge = BridgeStage(
            BridgeSets.of(described, section), described, self.autopilot, self.sequence
        )
        timing = Timing(self.plant.period)
        self.control = ControlTick.of(
            *(scenario, sets, bridge, timing, described),
            odometry=OdometryDrift.NAME in vehicle.numbers["effects"],
        )
        if self._faults:
            more = {"step": self._faults.step, "decides": False}
            self.control.insert("bridge", "faults", self._update_faults, **more)
            self.autopilot.link = self._faults
        self.ended_by = ""  # reason of an end before that of the mission
        self._limit = time_limit(scenario, sets["mission"])
        self._complete = False  # every kind of sensor has delivered
        self.newest: tuple | None = None  # sample of the autopilot's IMU, see `Samples.hil`
        length = scenario.landing.end + 12.0
        self.recording = FlightTable.of(int(length / self.plant.period), described)
        self.recorder = TickRecorder(
            *(self.recording, self.plant.truth_row, self.control, self.autopilot.motors),
            self.plant.period,
        )
        self.compiled = CompiledTicks(self)

    def run(self, progress: Callable[[float, str], object] | None = None) -> FlightTable:
        """Fly until mission and vehicle are at their end.

        progress(mission time [s], phase): called once a second; a true answer ends the flight.
        """
        plant, output = self.plant, self.mission.output
        ticks_a_second, settled = round(1.0 / plant.period), Settled()
        while not (output.done and settled.after_mission(plant.time, self.armed)):
            before, second = plant.tick, plant.tick // ticks_a_second
            left = int((self._limit - plant.time) / plant.period)
            try:
                self.advance((second + 1) * ticks_a_second - plant.tick, left)
                if plant.tick == before:
                    raise PhysicsError(f"{type(plant).__name__}.step() does not add 1 to `tick`")
            except PhysicsError as error:
                self.ended_by = str(error)
                break
            if plant.tick // ticks_a_second > second:
                if progress is not None and progress(output.time, output.phase):
                    break
                if settled.over(plant.time, self.armed):
                    self.ended_by = f"{self._silence} {DISARMED}".lstrip()
                    break
            if output.time < 0.0 and plant.time > LONGEST_WAIT:
                self.ended_by = self._silence
                if self.ended_by:  # the mission has no ticks in which it could end
                    break
                reasons = "; ".join(self.sequence.reasons) or "no reason"
                not_armed = f"the autopilot did not arm: {reasons}"
                against = self.mission.checks.beyond or self.mission.not_ready or not_armed
                self.mission.give_up(plant.time, against)
            if plant.time >= self._limit:
                self.ended_by = f"time limit of {self._limit:g} s"
                break
        return self.recording

    @property
    def _silence(self) -> str:
        """Since when there is no state, and why; "" while there are some."""
        silent = self.plant.time - self.control.mission.ahead / SECOND
        if silent <= STILL:
            return ""
        why = "IMU lost?" if self.control.mission.ahead > 0 else "a sensor without samples?"
        if self.control.estimator.diverged:
            why = "estimate diverged, samples not finite?"
        return f"no state of the estimator for {silent:.1f} s: {why}"

    @property
    def mission(self) -> Mission:
        return self.control.mission.mission

    @property
    def armed(self) -> bool:
        return self.autopilot.autopilot.commander.armed

    def outcome(self, info: Mapping[str, Any] | None = None, **more: Any) -> Outcome:
        """Return what the flight has come to; info: facts for its series; more: of the outcome."""
        recording, mission = self.recording, self.mission
        return Outcome(
            series=recording.series(info) if recording.count else None,
            abort_reason=mission.output.abort_reason,
            failure=self.ended_by,
            transitions=transitions(mission.changes),
            grasps=grasp_decisions(mission.grasps, mission.changes),
            faults=self._faults.records if self._faults else [],
            **more,
        )

    def advance(self, enough: int, most: int) -> None:
        """Fly at least one tick, and until `enough` are flown; at most `most`, which is not less.

        After `enough` it ends where it costs no time. Raises PhysicsError.
        """
        if not self.compiled.fly(min(enough, most), most):
            self.tick()

    def tick(self) -> None:
        """One control period of the whole vehicle."""
        self.sense()
        self.go_on(0)

    def sense(self) -> None:
        """Take the samples of a tick, whose true values are recorded."""
        plant, signals, recorder = self.plant, self.control.signals, self.recorder
        recorder.begin(plant.time, signals.magnet)
        self.autopilot.time = plant.time
        samples = plant.observe(recorder.truth())
        before, self.newest = self.newest, samples.hil
        imu = before if self.autopilot_imu else samples.imu
        self._deliver(samples, imu)

    def resume(self) -> None:
        """Go on after compiled ticks that have sensed last."""
        samples = self.plant.physics.arrived()
        self.newest = samples.hil
        self._deliver(samples, samples.imu)

    def go_on(self, stage: int) -> None:
        """Finish a tick from a number in `ControlTick.stages` on."""
        if self.control.go_on(stage):
            self.recorder.write(self.control.signals.phase)
        else:
            self.recorder.write_blind(self.mission.output.phase)
        self.cycle()
        self.push()

    def cycle(self) -> None:
        """Run the autopilot's cycle."""
        self.autopilot.update(*self.newest)

    def push(self) -> None:
        """Advance the physics by the tick."""
        signals = self.control.signals
        self.plant.step(self.autopilot.motors, signals.arm_command, signals.magnet)

    def _deliver(self, samples: Samples, imu: tuple | None) -> None:
        """Give samples to the stages, with stamps [ns]; imu: of the estimator.

        As the plant's node does, nothing is delivered before every kind of sensor has.
        """
        signals, joints, poses = self.control.signals, samples.joints, samples.poses
        if not self._complete:
            self._complete = bool(poses) and None not in (joints, imu)
            for sample in filter(None, (*poses, joints, imu, self.newest)):
                check_arrays(sample[1:])
        known, payload = self._complete, samples.payload
        signals.poses = [_stamped(pose) for pose in poses] if known else ()
        signals.joints, signals.imu, signals.payload, signals.grip = (
            _stamped(sample) if known and sample is not None else None
            for sample in (joints, imu, payload, samples.grip)
        )

    def _update_faults(self, control: ControlTick) -> bool:
        """Stage of a flight with faults: give plant and link the mission time and the phase."""
        signals = control.signals
        self._faults.update(signals.stamp / SECOND, signals.time, signals.phase)
        return True


def _stamped(sample: tuple) -> tuple:
    """Return a sample with its stamp in [ns] instead of [s]."""
    return nanoseconds(sample[0]), *sample[1:]


def fly(
    settings: FlightSettings, folder: ResultFolder, observer: Observer, stop: StopRequest
) -> Outcome:
    """Fly until the mission is done or a stop is requested."""
    observer.started(None)
    vehicle = Vehicle.of(settings.vehicle).changed(settings.vehicle_changes)
    flight = DirectFlight(
        settings.scenario,
        settings.profile,
        vehicle,
        settings.payload_mass,
        settings.seed,
        settings.faults,
        settings.plant,
        settings.imu == AUTOPILOT_IMU,
    )
    flight.say = observer.message
    folder.write_parameters({node: vars(values) for node, values in settings.profile.sets.items()})
    begin = time.monotonic()

    def report(_: float, __: str) -> bool:
        """Show where the flight is; return whether it ends."""
        if not stop.raised and flight.recording.count:
            observer.update(_status(flight, time.monotonic() - begin))
        return stop.raised

    flight.run(report)
    wall, interrupted = time.monotonic() - begin, stop.raised and not flight.mission.output.done
    return flight.outcome(wall_s=wall, interrupted=interrupted)


def _status(flight: DirectFlight, wall: float) -> FlightStatus:
    """Return where the flight is; wall [s]: since its begin."""
    recording = flight.recording
    row, output = recording.values[recording.count - 1], flight.mission.output
    columns = recording.columns
    size = columns.size
    estimate = row[columns.block("estimate.")][:size]
    error = estimate - row[columns.block("reference.")][:size]
    error[ATTITUDE.start :] = wrap_angle(error[ATTITUDE.start :])
    norms = [float(np.linalg.norm(error[part])) for part in (POSITION, ATTITUDE, ARM)]
    return FlightStatus(
        phase=output.phase,
        time=output.time,
        position_error=norms[0] * output.flying,
        attitude_error=norms[1] * output.flying,
        tilt=tilt(estimate[ATTITUDE]),
        arm_error=norms[2],
        real_time_factor=flight.plant.time / wall if wall > 0.0 else 0.0,
    )
