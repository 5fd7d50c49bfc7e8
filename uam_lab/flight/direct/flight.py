"""The direct engine: the objects of the nodes in one loop, without middleware and sockets.

One pass of the loop is one control tick, in the order of a lockstep flight with ROS: sensors,
estimator, controllers, bridge, mission for the next tick, autopilot, physics.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from uam_control.control.controllers import ArmController, AttitudeController, PositionController
from uam_control.estimation import StateEstimator
from uam_control.mission import Mission, Scenario
from uam_control.mission.time_limit import DISARMED, Settled, time_limit
from uam_control.profiles.profile import Profile
from uam_control.supervision import Inputs
from uam_lab.flight.direct.bridge import DirectBridge
from uam_lab.flight.direct.record import Snapshot, record, record_blind, record_switches
from uam_lab.results.timeseries import SUBSYSTEMS, FlightTable, gain_columns
from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.faults.direct import DirectFaults
from uam_sim_bridge.faults.faulty_plant import make_plant
from uam_sim_bridge.plant import Samples, Vehicle
from uam_sim_bridge.plant.engines import DEFAULT_PLANT

GAINS_TICKS = 25  # between two looks at the adapted gains for the supervisor
LONGEST_WAIT = 20.0  # [s] simulated, for the autopilot to get ready and armed


class DirectFlight:
    """One flight in the direct engine; `recording` fills while it flies.

    `mission.output` tells how it ended.
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
    ) -> None:
        """payload_mass [kg]; faults: those that `faults.limits.check` lets pass; plant: see
        `plant_class`."""
        sets = profile.sets
        started = (vehicle, payload_mass, seed, scenario.arm_start)
        self.plant = make_plant(*started, faults or Schedule(), plant)
        self._faults = DirectFaults(faults, self.plant) if faults else None
        self.estimator = StateEstimator(sets["state_estimator"])
        self.mission = Mission(scenario, sets["mission"])
        self.position = PositionController(sets["position_controller"])
        self.attitude = AttitudeController(sets["attitude_controller"])
        self.arm = ArmController(sets["arm_controller"])
        self.bridge = DirectBridge(profile.section("mavlink_bridge"), vehicle.description)
        self.inputs = Inputs(self.plant.period)
        if self._faults:
            self.bridge.passes = self._faults.link.passes
            self.bridge.receives = self._faults.link.receives
        self.ended_by = ""  # why it was ended although the mission was not done
        self._limit = time_limit(scenario)
        self._ahead = math.inf  # [s] stamp of the tick that the mission is ready for
        self._effort, self._magnet = np.zeros(self.plant.joints), False  # as last commanded
        self._lag = 0  # ticks from an IMU sample to its arrival
        self._truths: deque[Snapshot] = deque()  # of ticks whose IMU sample is on its way
        self._complete = False  # every kind of sensor has delivered
        controllers = self._controllers = (self.position, self.attitude, self.arm)
        self._gains = tuple(controller.adaptation for controller in controllers)
        self._gain_columns = tuple(
            gain_columns(subsystem, controller.names)
            for subsystem, controller in zip(SUBSYSTEMS, controllers, strict=True)
        )
        length = scenario.landing.at + scenario.landing.duration + 12.0
        self.recording = FlightTable(int(length / self.plant.period))

    def run(self, progress: Callable[[float, str], None] | None = None) -> FlightTable:
        """Fly until the mission is done; progress(mission time [s], phase) once a second."""
        plant, output = self.plant, self.mission.output
        ticks_a_second, settled = round(1.0 / plant.period), Settled()
        while not output.done:
            self.tick()
            if plant.tick % ticks_a_second == 0:
                if progress is not None:
                    progress(output.time, output.phase)
                if settled.over(plant.time, self.bridge.autopilot.commander.armed):
                    self.ended_by = DISARMED
                    break
            if output.time < 0.0 and plant.time > LONGEST_WAIT:
                reasons = "; ".join(self.bridge.sequence.reasons) or "no reason"
                against = self.mission.beyond or f"the autopilot did not arm: {reasons}"
                self.mission.give_up(plant.time, against)
            if plant.time >= self._limit:
                self.ended_by = f"time limit of {self._limit:g} s"
                break
        return self.recording

    @property
    def fault_records(self) -> list[dict[str, Any]]:
        """The faults that there were; see `faults.timeline.record`."""
        return self._faults.records if self._faults else []

    def tick(self) -> None:
        """One control period of the whole vehicle."""
        plant, mission, estimator, dt = self.plant, self.mission, self.estimator, self.plant.period
        samples = plant.sense()
        self._truths.append(Snapshot.of(plant))
        if not self._sensed(samples):
            self._blind_tick(samples)
            return
        stamp, state = samples.imu[0], estimator.update()
        if stamp > self._ahead + 0.5 * dt:  # after a gap, as the mission's node does
            mission.step(stamp, state, self.bridge.armed_since, self.inputs.at(stamp))
        output = mission.output
        if self._faults:
            self._faults.update(stamp, output.time)
        reference, flying, magnet = output.reference, output.flying, output.magnet

        tau_p = self.position.update(state, reference, flying, dt)
        attitude_reference = self.position.attitude_reference
        tau_q = self.attitude.update(state, reference, attitude_reference, flying, dt)
        tau_alpha = self.arm.update(state, reference, attitude_reference, flying, dt)
        self.bridge.identification.switch(stamp, magnet)
        self.bridge.send(stamp, plant.time, tau_p, tau_q, state, flying, output, samples.mocap)
        if self.bridge.connected(stamp):
            self.inputs.autopilot(stamp, math.nan)  # no link, no round trip
        motors = self.bridge.autopilot_tick(samples.hil)

        truth = self._truth_at(stamp)
        row = self.recording.next_row(output.phase)
        record(
            row,
            output.time,
            truth.state,
            state,
            reference,
            attitude_reference,
            tau_p,
            tau_q,
            tau_alpha,
            self.bridge.setpoint,
            self._gains,
            self._gain_columns,
            motors,
            truth.thrust,
            truth.payload_pose,
        )
        record_switches(row, magnet, truth, self.bridge.factor)

        self._effort[:], self._magnet, self._ahead = tau_alpha, magnet, stamp + dt
        self._lag = len(self._truths)
        plant.step(motors, tau_alpha, magnet)
        if plant.tick % GAINS_TICKS == 0:
            for subsystem, controller in zip(SUBSYSTEMS, self._controllers, strict=True):
                self.inputs.gains(stamp, subsystem, controller.names, controller.adaptation)
        mission.step(self._ahead, state, self.bridge.armed_since, self.inputs.at(stamp))

    def _blind_tick(self, samples: Samples) -> None:
        """One without an IMU sample: only autopilot and physics go on, with the last commands."""
        motors = self.bridge.autopilot_tick(samples.hil)
        if self.recording.count and len(self._truths) > self._lag:
            truth = self._truths.popleft()
            last = self.recording.count - 1
            row = self.recording.next_row(self.mission.output.phase)
            row[:] = self.recording.values[last]
            row[0] += self.plant.period
            record_blind(row, truth, motors)
        self.plant.step(motors, self._effort, self._magnet)

    def _sensed(self, samples: Samples) -> bool:
        """Feed the estimator; whether it has a state now. As the plant's node does, nothing is
        delivered before every kind of sensor has."""
        estimator = self.estimator
        here = samples.imu is not None
        self._complete = self._complete or (
            here and samples.mocap is not None and samples.joints is not None
        )
        if not self._complete:
            return False
        if samples.mocap is not None:
            estimator.mocap(*samples.mocap)
            self.inputs.mocap(*samples.mocap)
        if samples.joints is not None:
            estimator.joints(*samples.joints[:3])
            self.inputs.joints(samples.joints[0], samples.joints[3])
        if here:
            estimator.imu(*samples.imu)
        return here and not estimator.waiting_for

    def _truth_at(self, stamp: float) -> Snapshot:
        """What was true when the IMU sample of `stamp` [s] was taken."""
        truths = self._truths
        while truths[0].time < stamp - 1e-9:
            truths.popleft()
        return truths.popleft()
