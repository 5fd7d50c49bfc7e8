"""The direct engine: the objects of the nodes in one loop, without middleware and sockets.

One pass of the loop is one control tick, in the order of a lockstep flight with ROS: sensors,
estimator, controllers, bridge, mission for the next tick, autopilot, physics.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from uam_control import configuration
from uam_control.compiled import jit
from uam_control.controllers import ArmController, AttitudeController, PositionController
from uam_control.coordinates import ATTITUDE, POSITION
from uam_control.estimation import StateEstimator
from uam_control.mission import Mission, MissionOutput, Scenario
from uam_control.profile import Profile
from uam_control.supervision import Inputs, State
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.modes import CUSTOM_MODE_ENABLED, Command, Mode
from uam_sim_bridge.autopilot.params import Parameters
from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.faults.direct import DirectFaults
from uam_sim_bridge.flight.limits import DISARMED, Settled, time_limit
from uam_sim_bridge.flight.timeseries import COLUMNS, SUBSYSTEMS, Recording, gain_columns
from uam_sim_bridge.mavlink.frames import swap_body, swap_quaternion, swap_world
from uam_sim_bridge.mavlink.hold import UNKNOWN, HoldParameters, LevelHold
from uam_sim_bridge.mavlink.offboard import (
    HEARTBEAT_TIMEOUT,
    OffboardParameters,
    OffboardSequence,
    Request,
)
from uam_sim_bridge.mavlink.setpoint import RateThrustMap, RateThrustParameters, SetpointRefused
from uam_sim_bridge.mavlink.thrust_identification import (
    ThrustIdentification,
    ThrustIdentificationParameters,
)
from uam_sim_bridge.plant import Plant, Samples, Vehicle

GAINS_TICKS = 25  # between two looks at the adapted gains for the supervisor
LONGEST_WAIT = 20.0  # [s] simulated, for the autopilot to get ready and armed

IDLE = (np.zeros(3), 0.0)  # setpoint of a vehicle on the ground

# where each group of columns begins; constants of the compiled `record`
_TRUTH = COLUMNS.block("truth.").start
_ESTIMATE = COLUMNS.block("estimate.").start
_REFERENCE = COLUMNS.block("reference.").start
_TAU_P = COLUMNS["tau_p.x"]
_TAU_Q = COLUMNS["tau_q.roll"]
_TAU_ALPHA = COLUMNS["tau_alpha.1"]
_SETPOINT = COLUMNS["setpoint.rate_x"]
_FACTOR = COLUMNS["thrust.factor"]
_COMMAND = COLUMNS["rotor_1.command"]
_THRUST = COLUMNS["rotor_1.thrust"]
_PAYLOAD = COLUMNS.block("payload.").start
_MAGNET = COLUMNS["magnet.on"]


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
    ) -> None:
        """payload_mass [kg]; faults: those that `faults.limits.check` lets pass."""
        sets = profile.sets
        self._faults = DirectFaults(faults) if faults else None
        started = (vehicle, payload_mass, seed, scenario.arm_start)
        self.plant = self._faults.plant(*started) if self._faults else Plant(*started)
        self.estimator = StateEstimator(sets["state_estimator"])
        self.mission = Mission(scenario, sets["mission"])
        self.position = PositionController(sets["position_controller"])
        self.attitude = AttitudeController(sets["attitude_controller"])
        self.arm = ArmController(sets["arm_controller"])
        self.bridge = Bridge(profile.section("mavlink_bridge"))
        self.inputs = Inputs(self.plant.period)
        if self._faults:
            self.bridge.passes = self._faults.link.passes
            self.bridge.hears = self._faults.link.hears
        self.ended_by = ""  # why it was ended although the mission was not done
        self._limit = time_limit(scenario)
        self._ahead = math.inf  # [s] stamp of the tick that the mission is ready for
        self._effort, self._magnet = np.zeros(2), False  # as last commanded
        self._lag = 0  # ticks from an IMU sample to its arrival
        self._truths: deque[_Snapshot] = deque()  # of ticks whose IMU sample is on its way
        self._complete = False  # every kind of sensor has delivered
        controllers = self._controllers = (self.position, self.attitude, self.arm)
        self._gains = tuple(controller.adaptation for controller in controllers)
        self._gain_columns = tuple(
            gain_columns(subsystem, controller.names)
            for subsystem, controller in zip(SUBSYSTEMS, controllers, strict=True)
        )
        length = scenario.landing.at + scenario.landing.duration + 12.0
        self.recording = Recording(int(length / self.plant.period))

    def run(self, progress: Callable[[float, str], None] | None = None) -> Recording:
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
        self._truths.append(_Snapshot.of(plant))
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
            self.inputs.autopilot(stamp)
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
        row[_MAGNET], row[_MAGNET + 1], row[_MAGNET + 2] = (
            magnet,
            truth.magnet_force,
            truth.magnet_swing,
        )
        row[_FACTOR] = self.bridge.factor

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
            row[_TRUTH : _TRUTH + truth.state.size] = truth.state.ravel()
            row[_COMMAND : _COMMAND + 4], row[_THRUST : _THRUST + 4] = motors, truth.thrust
            row[_PAYLOAD : _PAYLOAD + 7] = truth.payload_pose
            row[_MAGNET + 1], row[_MAGNET + 2] = truth.magnet_force, truth.magnet_swing
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
            self.inputs.mocap(samples.mocap[0])
        if samples.joints is not None:
            estimator.joints(*samples.joints[:3])
            self.inputs.joints(samples.joints[0], samples.joints[3])
        if here:
            estimator.imu(*samples.imu)
        return here and not estimator.waiting_for

    def _truth_at(self, stamp: float) -> _Snapshot:
        """What was true when the IMU sample of `stamp` [s] was taken."""
        truths = self._truths
        while truths[0].time < stamp - 1e-9:
            truths.popleft()
        return truths.popleft()


class _Snapshot(NamedTuple):
    """The truth of one tick, at plant time [s]; see `plant.Truth`."""

    time: float
    state: np.ndarray
    thrust: np.ndarray
    payload_pose: np.ndarray
    magnet_force: float
    magnet_swing: float

    @classmethod
    def of(cls, plant: Plant) -> _Snapshot:
        """A copy of what is true now."""
        state = np.empty((3, 8))
        plant.write_truth_state(state)
        return cls(
            plant.time,
            state,
            plant.rotors.thrust.copy(),
            plant.payload_pose.copy(),
            plant.magnet_force,
            plant.magnet_swing,
        )


class Bridge:
    """What the MAVLink bridge and the autopilot do, joined without a link.

    `setpoint` (4,): body rates [rad/s, FLU] and normalised thrust of the last tick; `factor`: the
    thrust factor it was made with.
    """

    def __init__(self, section: Mapping[str, Any]) -> None:
        """section: what the profile says of the mavlink_bridge node; {} for its defaults."""
        self.map = RateThrustMap(RateThrustParameters.among(section))
        self.identification = ThrustIdentification(ThrustIdentificationParameters.among(section))
        self.sequence = OffboardSequence(OffboardParameters.among(section))
        self._hold = LevelHold(HoldParameters.among(section))
        self.autopilot = Autopilot(Parameters.load(configuration.path("autopilot/s500.yaml")))
        self.setpoint = np.zeros(4)
        self.factor = 1.0
        self.passes: Callable[[], bool] = lambda: True  # whether a message reaches the autopilot
        self.hears: Callable[[], bool] = lambda: True  # whether one of the autopilot arrives
        self._heard = 0.0  # stamp [s] of the last one

    @property
    def armed_since(self) -> float | None:
        """Stamp [s] at which the autopilot was first seen armed, None while it is not."""
        return self.sequence.armed_stamp if self.autopilot.commander.armed else None

    def connected(self, stamp: float) -> bool:
        """Whether a heartbeat came within the last seconds before `stamp` [s]."""
        return stamp - self._heard < HEARTBEAT_TIMEOUT

    def send(
        self,
        stamp: float,
        time: float,
        tau_p: np.ndarray,
        tau_q: np.ndarray,
        state: np.ndarray,
        flying: bool,
        wanted: MissionOutput,
        mocap: tuple | None,
    ) -> None:
        """One tick of the bridge: vision, requests, setpoint.

        stamp: of the tick's IMU sample [s], the bridge's clock; time: the autopilot's [s]; wanted:
        the mission's output.
        """
        autopilot, setpoint = self.autopilot, self.setpoint
        if mocap is not None and self.passes():
            autopilot.vision(time, swap_world(mocap[1]), swap_quaternion(mocap[2]))
        if self.hears():
            self._heard = stamp
        self.sequence.want(wanted.arm)
        self.sequence.let_go = wanted.state is State.FAILSAFE
        status = autopilot.commander
        request = self.sequence.update(stamp, True, status.armed, status.mode)
        if request is not None and self.passes():
            self._request(time, request)
        command = self._command(stamp, tau_p, tau_q, state, flying)
        setpoint[:] = 0.0
        if command is not None:
            setpoint[0:3], setpoint[3] = command
        if command is not None and self.passes():
            autopilot.setpoint(time, swap_body(setpoint), setpoint[3])
        thrust, self.factor = float(setpoint[3]), self.map.thrust_factor
        self.map.thrust_factor = self.identification.update(
            stamp, state, thrust, self.map.assumed_thrust(thrust), flying and status.armed
        )

    def _command(
        self, stamp: float, tau_p: np.ndarray, tau_q: np.ndarray, state: np.ndarray, flying: bool
    ) -> tuple[np.ndarray, float] | None:
        """Rates (3,) and thrust of this tick, None for no setpoint: what the node does."""
        if flying:
            try:
                rates, thrust = self.map.map(tau_p, tau_q, state[0, 3:6], state[1, 3:6])
            except SetpointRefused:
                return self._hold.setpoint(stamp, state[0, ATTITUDE], state[1, POSITION])
            self._hold.good(stamp, thrust)
            return rates, thrust
        if self.sequence.let_go and self.autopilot.commander.armed:
            return self._hold.setpoint(stamp, state[0, ATTITUDE], UNKNOWN, hopeless=True)
        return IDLE

    def _request(self, time: float, request: Request) -> None:
        if request is Request.OFFBOARD:
            result = self.autopilot.command(
                time, Command.DO_SET_MODE, (CUSTOM_MODE_ENABLED, *Mode.OFFBOARD.value)
            )
        else:
            result = self.autopilot.command(
                time, Command.ARM_DISARM, (float(request is Request.ARM), 0.0)
            )
        self.sequence.answer(request, result)

    def autopilot_tick(self, hil: tuple) -> np.ndarray:
        """One cycle of the autopilot on its own IMU sample; returns its motor commands (4,)."""
        stamp, gyro, force = hil
        return self.autopilot.update(stamp, swap_body(gyro), swap_body(force))


@jit
def record(
    row: np.ndarray,
    time: float,
    truth: np.ndarray,
    state: np.ndarray,
    reference: np.ndarray,
    attitude_reference: np.ndarray,
    tau_p: np.ndarray,
    tau_q: np.ndarray,
    tau_alpha: np.ndarray,
    setpoint: np.ndarray,
    gains: tuple[np.ndarray, ...],
    gain_columns: tuple[np.ndarray, ...],
    motors: np.ndarray,
    thrust: np.ndarray,
    payload_pose: np.ndarray,
) -> None:
    """Copy one tick into its row of the recording; roll and pitch reference are what tau_p asks.

    gains, gain_columns: three arrays each, the published gains and where they go.
    """
    row[0] = time
    for i in range(3):
        for j in range(8):
            row[_TRUTH + 8 * i + j] = truth[i, j]
            row[_ESTIMATE + 8 * i + j] = state[i, j]
            row[_REFERENCE + 8 * i + j] = reference[i, j]
        for j in range(3):
            row[_REFERENCE + 8 * i + 3 + j] = attitude_reference[i, j]
        row[_TAU_P + i] = tau_p[i]
        row[_TAU_Q + i] = tau_q[i]
    for i in range(2):
        row[_TAU_ALPHA + i] = tau_alpha[i]
    for i in range(4):
        row[_SETPOINT + i] = setpoint[i]
        row[_COMMAND + i] = motors[i]
        row[_THRUST + i] = thrust[i]
    for i in range(7):
        row[_PAYLOAD + i] = payload_pose[i]
    for subsystem in range(3):
        columns, values = gain_columns[subsystem], gains[subsystem]
        for i in range(len(columns)):
            row[columns[i]] = values[i]
