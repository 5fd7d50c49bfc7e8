"""The autopilot stand-in without sockets: sensor sample in, motor commands out.

`server` adds MAVLink; the direct engine calls it directly. All vectors are FRD and NED; time [s] is
that of the sensor samples. One `update` is one cycle of PX4's rate loop (gyro filter, rate PID,
allocation, thrust model) with attitude loop, commander, land detector and estimator.
"""

import math
from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import prepared
from uam_control.maths.memory import Known, Number, record
from uam_control.offboard.firmware import FIRMWARES, PX4, Firmware
from uam_control.offboard.modes import CUSTOM_MODE_ENABLED, FORCE, MavCmd, MavResult, Mode
from uam_control.setpoints.targets import (
    ATTITUDE_AND_YAW_RATE,
    RATES,
    PositionTarget,
    Target,
    WrenchTarget,
)
from uam_control.vehicle import load_description
from uam_control.vehicle.rotor_geometry import normalised_mixer
from uam_sim_bridge.autopilot.autopilot_estimator import ATTITUDE as ESTIMATED_ATTITUDE
from uam_sim_bridge.autopilot.autopilot_estimator import POSITION, VELOCITY, Estimator
from uam_sim_bridge.autopilot.commander import Commander, SimulatedBattery
from uam_sim_bridge.autopilot.cycle import (
    LONGEST_STEP,
    SHORTEST_STEP,
    CycleArrays,
    RateLoop,
    control_tick,
    drive_motors,
    fly_rates,
    learn_hover,
    take_vision,
)
from uam_sim_bridge.autopilot.landing import LandDetector
from uam_sim_bridge.autopilot.loops.attitude_control import attitude_gains, attitude_rates
from uam_sim_bridge.autopilot.loops.position_modes import MODES, PositionControl, PositionModes
from uam_sim_bridge.autopilot.loops.rate_control import (
    INTEGRAL,
    TORQUE,
    filter_coefficients,
    reset_filters,
)
from uam_sim_bridge.autopilot.loops.rate_control import RATES as FILTERED
from uam_sim_bridge.autopilot.params import Parameters

ACTUATORS = 6  # of DO_SET_ACTUATOR


class AutopilotStatus(NamedTuple):
    """State of the autopilot as reported to a companion computer."""

    armed: bool
    mode: Mode
    landed: bool
    failsafe: bool
    intended: Mode = Mode.UNKNOWN
    killed: bool = False  # by the kill switch or flight termination


class Autopilot:
    """PX4-class autopilot.

    `motors` (rotors,): commands 0..1 in PX4's order, zero while disarmed; each `update` overwrites
    them.
    """

    _time = Known()
    _hover, _usual_hover = Number(), Number()  # thrust, see `learn_hover`

    def __init__(
        self,
        parameters: Parameters | None = None,
        sample_rate: float = 250.0,
        spoken: Firmware = FIRMWARES[PX4],
    ) -> None:
        """parameters: None for those of the default vehicle; sample_rate [Hz]: of `update`;
        spoken: whose numbers its modes have."""
        self.firmware = spoken
        self.parameters = parameters or Parameters.of(load_description())
        self.motors = np.zeros(int(self.parameters["CA_ROTOR_COUNT"]))
        self.estimator = Estimator()
        self.commander = Commander(self.parameters)
        self.landing = LandDetector(self.parameters)
        self.battery = SimulatedBattery(self.parameters)
        self._position_modes = PositionModes(self.parameters)
        self._setpoint = np.zeros(4)  # body rates [rad/s, FRD], thrust
        self._position: PositionTarget | None = None  # flown in place of body rates or attitude
        self._position_control = PositionControl(self.parameters)
        self._torque: np.ndarray | None = None  # normalised, FRD, flown without the rate loop
        self._desired: np.ndarray | None = None  # attitude FRD → NED, None: body rates are flown
        self._yaw_rate = 0.0  # [rad/s] about the world's z axis, down
        self._memory = np.zeros((7, 3))
        self.rates = self._memory[FILTERED]  # filtered body rates (3,) [rad/s, FRD]
        self._velocity = self.estimator.estimate[VELOCITY]
        self.memory = record("", "time loss_time low_thrust hover usual_hover")
        self._time = None
        self._flew_rates = False  # in the last cycle; no own mode of the autopilot did
        self.actuators = np.full(ACTUATORS, np.nan)  # set by DO_SET_ACTUATOR; NaN: disarmed value
        self.gripper: dict[int, bool] = {}  # number → whether DO_GRIPPER has closed it
        self.imu = np.zeros(3), np.zeros(3)  # newest sample: gyro, specific force, as in `update`
        self._sample_rate = sample_rate
        self._configure()

    @property
    def outputs(self) -> list[float]:
        """The outputs of actuator set and grippers (6), -1..1; 0: the disarmed value."""
        values = [0.0 if math.isnan(value) else value for value in self.actuators.tolist()]
        for number, closed in self.gripper.items():
            if 1 <= number <= ACTUATORS:
                values[number - 1] = 1.0 if closed else -1.0
        return values

    def set_parameter(self, name: str, value: float) -> None:
        """Change one parameter in flight; raises ParameterError, without a change, if refused."""
        old = self.parameters[name] if name in self.parameters.names else 0.0
        self.parameters.set(name, value)
        try:
            self._configure()
        except ValueError:
            self.parameters.set(name, old)
            raise

    def set_sample_rate(self, sample_rate: float) -> None:
        """Recompute the filters for another rate of samples [Hz]."""
        self._sample_rate = sample_rate
        self._configure()

    def target(self, time: float, target: Target) -> str:
        """Set the setpoint; return why it is refused, else "".

        A setpoint that is not finite is refused; the thrust is clamped to 0..1.
        """
        refused = target.refused()
        if refused:
            return refused
        if isinstance(target, PositionTarget):
            self._position, self._torque = target, None
            self.commander.setpoint(time)
            return ""
        self._position = self._desired = self._torque = None
        setpoint = self._setpoint
        setpoint[3] = min(1.0, max(0.0, target.thrust))
        if isinstance(target, WrenchTarget):
            self._torque = np.clip(target.torque, -1.0, 1.0)
            self.commander.setpoint(time)
            return ""
        rates = target.rates
        setpoint[:3] = rates
        if target.type_mask != RATES:
            self._desired = target.quaternion / np.linalg.norm(target.quaternion)
            self._yaw_rate = rates[2] if target.type_mask == ATTITUDE_AND_YAW_RATE else 0.0
        self.commander.setpoint(time)
        return ""

    def vision(
        self, time: float, position: np.ndarray, quaternion: np.ndarray, age: float = 0.0
    ) -> bool:
        """See `take_vision`."""
        return self._take_vision(time, position, quaternion, age, self.estimator.arrays)

    def manual(self, time: float, sticks: tuple[float, float, float, float]) -> None:
        """Handle the pilot's sticks: forward, right, up, yaw clockwise, each -1..1 (finite)."""
        self._position_modes.sticks[:] = sticks
        self.commander.sticks(time, sticks, self.estimator.aided(time))

    def kill_switch(self, engaged: bool) -> None:
        self.commander.kill(engaged, self.landing.landed)

    def command(self, time: float, command: int, parameters: tuple[float, ...]) -> MavResult:
        """Handle a command with COMMAND_LONG's seven parameters.

        DO_SET_MODE, ARM_DISARM, DO_FLIGHTTERMINATION, DO_SET_ACTUATOR, DO_GRIPPER; others:
        UNSUPPORTED.
        """
        first, second = parameters[0], parameters[1]
        if command == MavCmd.ARM_DISARM:
            force = second == FORCE
            if first == 0.0:
                return self.commander.request_disarm(self.landing.landed, force)
            if first != 1.0:
                return MavResult.DENIED
            flies = self.commander.armed
            result = self.commander.request_arm(time, [] if force else self.estimator.faults(time))
            if result is MavResult.ACCEPTED and not flies:
                self._position_modes.home[:] = self.estimator.estimate[POSITION]
            return result
        if command == MavCmd.DO_SET_MODE:
            if not (math.isfinite(first) and int(first) & CUSTOM_MODE_ENABLED):
                return MavResult.DENIED
            third = parameters[2]
            if not (math.isfinite(second) and math.isfinite(third)):
                return MavResult.DENIED
            mode = self.firmware.requested(int(second), int(third))
            if mode is Mode.UNKNOWN:
                return MavResult.DENIED
            return self.commander.request_mode(time, mode, self.estimator.aided(time))
        if command == MavCmd.DO_FLIGHTTERMINATION:
            return self.commander.terminate() if first > 0.5 else MavResult.DENIED
        if command == MavCmd.DO_SET_ACTUATOR:
            if not parameters[ACTUATORS]:  # index of the set; PX4 accepts others and ignores them
                given = np.array(parameters[:ACTUATORS])
                self.actuators = np.where(np.isfinite(given), given, self.actuators)
            return MavResult.ACCEPTED
        if command == MavCmd.DO_GRIPPER and math.isfinite(first):
            if second not in (0.0, 1.0):
                return MavResult.DENIED
            self.gripper[int(first)] = second == 1.0
            return MavResult.ACCEPTED
        return MavResult.UNSUPPORTED

    def update(self, time: float, gyro: np.ndarray, accel: np.ndarray) -> np.ndarray:
        """Advance to `time` [s] and return `motors`.

        gyro (3,) [rad/s] and specific force accel (3,) [m/s^2], FRD, float64 (at rest z = -g).
        """
        if self.settled and self._fly_rates(self.arrays, time, gyro, accel):
            self.imu = gyro, accel
            return self.motors
        if self._time is None:
            self._time = time - 1.0 / self._sample_rate
            reset_filters(gyro, self._filters, self._memory)
        dt = min(LONGEST_STEP, max(SHORTEST_STEP, time - self._time))
        self._time = time
        self.imu = gyro, accel
        commander, landing = self.commander, self.landing
        aided = self.estimator.predict(time, gyro, accel, dt)
        if landing.landed:
            self.estimator.stands(dt)
            self._hover = self._usual_hover
        self.battery.update(time, commander.armed)
        commander.update(time, landing.landed, self.battery.state)
        setpoint = self._setpoint
        descending = self._flew_rates = False
        if self._position is None or not commander.armed or commander.mode is not Mode.OFFBOARD:
            self._position_control.reset()
        if commander.armed and commander.mode is not Mode.OFFBOARD:
            setpoint, descending = self._own_setpoint(commander.mode, aided, dt)
        elif commander.armed and self._position is not None and not aided:
            setpoint, descending = self._descend(dt), True
        else:
            self._position_modes.reset()
            self._flew_rates = True
            if commander.armed and self._position is not None:
                estimate = self.estimator.estimate
                setpoint = self._position_control.update(self._position, estimate, dt)
            elif self._desired is not None:
                attitude = self.estimator.estimate[ESTIMATED_ATTITUDE]
                attitude_rates(
                    attitude, self._desired, self._yaw_rate, self._attitude_gains, setpoint
                )
        landed = landing.maybe_landed
        self._control_tick(gyro, dt, commander.armed, landed, setpoint, self._loop)
        if self._flew_rates and commander.armed:
            if self._torque is not None:
                self.allocate(self._torque, setpoint[3])
            if not landing.landed:
                force = self.arrays.estimator.mean_force
                learn_hover(self.memory, force, float(setpoint[3]), dt)
        if commander.stopped:
            self.motors[:] = 0.0
        velocity = self._velocity
        if not aided:  # across, the IMU alone is soon wrong
            velocity = (0.0, 0.0, velocity[2]) if self._sink_known(time) else None
        landing.update(time, commander.armed, descending, float(setpoint[3]), self.rates, velocity)
        return self.motors

    def rate_loop(self, gyro: np.ndarray, dt: float, setpoint: np.ndarray) -> np.ndarray:
        """Run one cycle of the rate loop alone, armed and in flight; return `motors`.

        gyro (3,) [rad/s, FRD]; dt [s]; setpoint (4,): body rates [rad/s, FRD], thrust 0..1.
        """
        self._control_tick(gyro, dt, True, False, setpoint, self._loop)
        return self.motors

    def allocate(self, torque: np.ndarray, thrust: float) -> np.ndarray:
        """Drive the motors without the rate loop; return `motors`.

        torque (3,): normalised, FRD; thrust 0..1.
        """
        self._memory[TORQUE], self._memory[INTEGRAL] = torque, 0.0
        drive_motors(thrust, self._loop)
        return self.motors

    @property
    def settled(self) -> bool:
        """Whether nothing is to be decided but by thrust and stream, see `fly_rates`."""
        others = self._position, self._desired, self._torque
        rates = self._flew_rates and all(other is None for other in others)
        battery = self.battery.charge is not None or self.parameters["SIM_BAT_ENABLE"]
        return rates and not battery and self.commander.flies_offboard and self.landing.flies

    @property
    def status(self) -> AutopilotStatus:
        """The state that HEARTBEAT and EXTENDED_SYS_STATE report."""
        c = self.commander
        landed = self.landing.landed
        return AutopilotStatus(c.armed, c.mode, landed, c.failsafe, c.intended, c.stopped)

    def _own_setpoint(self, mode: Mode, aided: bool, dt: float) -> tuple[np.ndarray, bool]:
        """Return the setpoint (4,) of a mode without a companion, and whether it descends."""
        if mode is Mode.TERMINATION:
            return np.zeros(4), False
        if mode in MODES and aided:
            modes = self._position_modes
            setpoint = modes.fly(mode, self.estimator.estimate, dt, self._hover)
            if self.landing.landed and not modes.climbing:  # PX4 idles until it takes off
                modes.reset()
                setpoint[:] = 0.0
            return setpoint, modes.sinking
        return self._descend(dt), True

    def _descend(self, dt: float) -> np.ndarray:
        """Return the setpoint (4,) of the level descent."""
        known, contact = self._sink_known(self._time), self.landing.contact
        return self._position_modes.descend(
            self.estimator.estimate, dt, known, contact, self._hover
        )

    def _sink_known(self, time: float) -> bool:
        return self.estimator.unaided_for(time) < self.parameters["EKF2_NOAID_TOUT"] * 1e-6

    def _configure(self) -> None:
        p = self.parameters
        mixer = normalised_mixer(*map(np.array, p.rotors()))
        inverse = np.ascontiguousarray(np.linalg.pinv(mixer))
        axes = ("ROLLRATE", "PITCHRATE", "YAWRATE")
        k = np.array([p[f"MC_{axis}_K"] for axis in axes])
        gains = np.array(
            [[p[f"MC_{axis}_{what}"] for axis in axes] for what in "PID"]
            + [
                [p[f"MC_{axis}_FF"] for axis in axes],
                p.vector("MC_RR_INT_LIM", "MC_PR_INT_LIM", "MC_YR_INT_LIM"),
            ]
        )
        gains[:3] *= k
        self._filters = filter_coefficients(
            self._sample_rate, p["IMU_GYRO_CUTOFF"], p["IMU_DGYRO_CUTOFF"], p["MC_YAW_TQ_CUTOFF"]
        )
        factor = float(p["THR_MDL_FAC"])
        self._loop = RateLoop(
            *(factor, self._filters, gains, mixer, inverse, self._memory, self.motors)
        )
        self._control_tick = prepared(
            control_tick, np.zeros(3), 0.0, True, True, self._setpoint, self._loop
        )
        self._attitude_gains = attitude_gains(p)
        self.landing.configure(p)
        self._usual_hover = float(p["MPC_THR_HOVER"])
        self.memory["loss_time"], self.memory["low_thrust"] = p["COM_OF_LOSS_T"], self.landing.low
        self.arrays = CycleArrays(
            *(self._loop, self.estimator.arrays, self._setpoint),
            *(self.commander.memory, self.memory),
        )
        still = np.zeros(3)
        self._fly_rates = prepared(fly_rates, self.arrays, 0.0, still, still)
        self._take_vision = prepared(
            take_vision, 0.0, still, np.zeros(4), 0.0, self.estimator.arrays
        )
        self._position_modes.configure(p)
        self._position_control.configure(p)
