"""The direct engine: the objects of the nodes in one loop, without middleware and sockets.

One pass of the loop is one control tick, in the order of a lockstep flight with ROS: sensors,
estimator, controllers, bridge, mission for the next tick, autopilot, physics.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from uam_control import configuration
from uam_control.compiled import jit
from uam_control.controllers import ArmController, AttitudeController, PositionController
from uam_control.estimation import StateEstimator
from uam_control.mission import Mission, Scenario
from uam_control.profile import Profile
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.modes import CUSTOM_MODE_ENABLED, Command, Mode
from uam_sim_bridge.autopilot.params import Parameters
from uam_sim_bridge.flight.timeseries import COLUMNS, Recording
from uam_sim_bridge.mavlink.frames import swap_body, swap_quaternion, swap_world
from uam_sim_bridge.mavlink.offboard import OffboardSequence, Request
from uam_sim_bridge.mavlink.setpoint import RateThrustMap
from uam_sim_bridge.plant import Plant, Vehicle

LONGEST_WAIT = 20.0  # [s] simulated, for the autopilot to get ready and armed

_TRUTH = COLUMNS.block("truth.")
_ESTIMATE = COLUMNS.block("estimate.")
_REFERENCE = COLUMNS.block("reference.")
_INPUTS = slice(COLUMNS["tau_p.x"], COLUMNS["setpoint.thrust"] + 1)
_ADAPTATION = COLUMNS.block("adaptation.")
_ROTORS = slice(COLUMNS["rotor_1.command"], COLUMNS["rotor_4.thrust"] + 1)
_PAYLOAD = COLUMNS.block("payload.")
_MAGNET = COLUMNS.block("magnet.")


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
    ) -> None:
        sets = profile.sets
        self.plant = Plant(vehicle, payload_mass, seed, scenario.arm_start)
        self.estimator = StateEstimator(sets["state_estimator"])
        self.mission = Mission(scenario, sets["mission"])
        self.position = PositionController(sets["position_controller"])
        self.attitude = AttitudeController(sets["attitude_controller"])
        self.arm = ArmController(sets["arm_controller"])
        self.bridge = Bridge(profile)
        length = scenario.landing.at + scenario.landing.duration + 12.0
        self.recording = Recording(int(length / self.plant.period))

    def run(self, progress: Callable[[float, str], None] | None = None) -> Recording:
        """Fly until the mission is done; progress(mission time [s], phase) once a second."""
        plant, output = self.plant, self.mission.output
        ticks_a_second = round(1.0 / plant.period)
        while not output.done:
            self.tick()
            if progress is not None and plant.tick % ticks_a_second == 0:
                progress(output.time, output.phase)
            if output.time < 0.0 and plant.time > LONGEST_WAIT:
                reasons = "; ".join(self.bridge.sequence.reasons)
                self.mission.abort(plant.time, f"the autopilot did not arm: {reasons or 'no reason'}")
        return self.recording

    def tick(self) -> None:
        """One control period of the whole vehicle."""
        plant, mission, estimator, dt = self.plant, self.mission, self.estimator, self.plant.period
        samples = plant.sense()
        if samples.mocap is not None:
            estimator.mocap(*samples.mocap)
        if samples.joints is not None:
            estimator.joints(*samples.joints[:3])
        if samples.imu is not None:
            estimator.imu(*samples.imu)
        if estimator.waiting_for:
            motors = self.bridge.autopilot_tick(samples.hil)
            plant.step(motors, np.zeros(2), False)
            return
        state = estimator.update()
        output = mission.output
        reference, flying, magnet = output.reference, output.flying, output.magnet
        time, phase = output.time, output.phase

        tau_p = self.position.update(state, reference, flying, dt)
        attitude_reference = self.position.attitude_reference
        tau_q = self.attitude.update(state, reference, attitude_reference, flying, dt)
        tau_alpha = self.arm.update(state, reference, attitude_reference, flying, dt)
        self.bridge.send(plant.time, tau_p, tau_q, state, flying, output.arm, samples.mocap)
        motors = self.bridge.autopilot_tick(samples.hil)

        row = self.recording.next_row(phase)
        row[0] = time
        plant.write_truth_state(row[_TRUTH].reshape(3, 8))
        record(state, reference, attitude_reference, tau_p, tau_q, tau_alpha, self.bridge.setpoint,
               row[_ESTIMATE], row[_REFERENCE], row[_INPUTS])
        adaptation = row[_ADAPTATION]
        adaptation[0:7] = self.position.adaptation
        adaptation[7:14] = self.attitude.adaptation
        adaptation[14:21] = self.arm.adaptation
        rotors = row[_ROTORS]
        rotors[0:4] = motors
        rotors[4:8] = plant.rotors.thrust
        plant.write_payload(row[_PAYLOAD])
        row[_MAGNET] = magnet, plant.magnet_force, plant.magnet_swing

        plant.step(motors, tau_alpha, magnet)
        mission.step(plant.time, state, self.bridge.sequence.armed_stamp)


class Bridge:
    """What the MAVLink bridge and the autopilot do, joined without a link.

    `setpoint` (4,): body rates [rad/s, FLU] and normalised thrust of the last tick.
    """

    def __init__(self, profile: Profile) -> None:
        self.map = RateThrustMap()
        self.sequence = OffboardSequence()
        self.autopilot = Autopilot(Parameters.load(configuration.path("autopilot/s500.yaml")))
        self.setpoint = np.zeros(4)

    def send(self, time, tau_p, tau_q, state, flying, arm, mocap) -> None:
        """One tick of the bridge: vision, requests, setpoint."""
        autopilot, setpoint = self.autopilot, self.setpoint
        if mocap is not None:
            autopilot.vision(time, swap_world(mocap[1]), swap_quaternion(mocap[2]))
        self.sequence.want(arm)
        status = autopilot.commander
        request = self.sequence.update(time, True, status.armed, status.mode)
        if request is not None:
            self._request(time, request)
        if flying:
            rates, setpoint[3] = self.map.map(tau_p, tau_q, state[0, 3:6], state[1, 3:6])
            setpoint[0:3] = rates
        else:
            setpoint[:] = 0.0
        autopilot.setpoint(time, swap_body(setpoint), setpoint[3])

    def _request(self, time: float, request: Request) -> None:
        if request is Request.OFFBOARD:
            result = self.autopilot.command(
                time, Command.DO_SET_MODE, (CUSTOM_MODE_ENABLED, *Mode.OFFBOARD.value))
        else:
            result = self.autopilot.command(
                time, Command.ARM_DISARM, (float(request is Request.ARM), 0.0))
        self.sequence.answer(request, result)

    def autopilot_tick(self, hil: tuple) -> np.ndarray:
        """One cycle of the autopilot on its own IMU sample; returns its motor commands (4,)."""
        stamp, gyro, force = hil
        return self.autopilot.update(stamp, swap_body(gyro), swap_body(force))


@jit
def record(state, reference, attitude_reference, tau_p, tau_q, tau_alpha, setpoint, estimated,
           referenced, inputs):
    """Copy one tick into its row of the recording; roll and pitch reference are what tau_p asks."""
    for i in range(3):
        for j in range(8):
            estimated[8 * i + j] = state[i, j]
            referenced[8 * i + j] = reference[i, j]
        for j in range(3):
            referenced[8 * i + 3 + j] = attitude_reference[i, j]
        inputs[i] = tau_p[i]
        inputs[3 + i] = tau_q[i]
    for i in range(2):
        inputs[6 + i] = tau_alpha[i]
    for i in range(4):
        inputs[8 + i] = setpoint[i]
