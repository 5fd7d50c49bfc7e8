"""One control tick, from sensor samples to the autopilot's setpoint: all stages in order.

STAGES at the end of this file is the block diagram. The direct engine calls `ControlTick.tick`. In
a flight over ROS each stage runs in a node of its own, and the signals are topics.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from uam_control.control.controllers import ArmController, AttitudeController, PositionController
from uam_control.coordinates import ARM, POSITION, coordinates
from uam_control.mission import Mission, Scenario, StartParameters
from uam_control.setpoints.setpoint_source import Setpoint
from uam_control.settings.parameter_set import ParameterSet
from uam_control.stages.autopilot_report import AutopilotReport
from uam_control.stages.bridge_stage import BridgeStage
from uam_control.stages.estimator_stage import estimator_stage
from uam_control.stages.law_stages import LawStage, MeasuredDelay
from uam_control.stages.mission_stage import MissionStage
from uam_control.stages.timing import Timing
from uam_control.stamps import SECOND
from uam_control.supervision import Authority, State
from uam_control.vehicle import VehicleDescription

Pose = tuple[int, np.ndarray, np.ndarray]  # stamp [ns], position (3,) [m], quaternion [w x y z]
Joints = tuple[int, np.ndarray, np.ndarray, np.ndarray]  # stamp, angles, speeds, efforts (n,)
Imu = tuple[int, np.ndarray, np.ndarray]  # stamp, gyro (3,) [rad/s], specific force (3,) [m/s^2]


@dataclass
class Signals:
    """The signals between the stages at one tick. The next tick overwrites the same arrays.

    SIZE is 6 + n for an arm of n joints.
    """

    # estimator
    state: np.ndarray  # (3, SIZE) chi, chi_dot, chi_ddot, see `coordinates`
    # mission
    reference: np.ndarray  # (3, SIZE) chi_d, chi_d_dot, chi_d_ddot
    # laws
    tau_alpha: np.ndarray  # (n,) [N m]
    arm_command: np.ndarray  # (n,) see `ArmController.command`
    tau_p: np.ndarray  # (3,) [N, ENU]
    attitude_reference: np.ndarray  # (3, 3) rows q_d [rad], Omega_d, Omega_d_dot, FLU
    tau_q: np.ndarray  # (3,) [N m, FLU]
    # samples that arrived at this tick
    mocap: Pose | None = None
    joints: Joints | None = None
    imu: Imu | None = None
    payload: Pose | None = None
    stamp: int = -1  # [ns] of the IMU sample; names the tick
    # mission
    flying: bool = False  # whether position and attitude are controlled
    magnet: bool = False
    time: float = -1.0  # [s] since take-off, negative before
    phase: str = ""
    # bridge
    setpoint: Setpoint = None  # as sent to the autopilot; None: no setpoint was sent
    thrust_factor: float = 1.0  # used for the setpoint

    @classmethod
    def at_rest(cls, joints: int) -> Self:
        """Return the signals before the first tick: everything zero."""
        size = len(coordinates(joints))
        return cls(
            state=np.zeros((3, size)),
            reference=np.zeros((3, size)),
            tau_alpha=np.zeros(joints),
            arm_command=np.zeros(joints),
            tau_p=np.zeros(3),
            attitude_reference=np.zeros((3, 3)),
            tau_q=np.zeros(3),
        )


class ControlTick:
    """All stages in one process, and the `signals` between them.

    `stages`: STAGES; further ones may be inserted before the first tick.
    """

    def __init__(
        self,
        scenario: Scenario,
        sets: Mapping[str, ParameterSet],
        bridge: BridgeStage,
        timing: Timing,
        vehicle: VehicleDescription | None = None,
    ) -> None:
        """sets: parameters by the names of the nodes, see `Profile.sets`; vehicle: whose limits the
        begin of the reference is compared with, if given."""
        self.signals = Signals.at_rest(len(scenario.arm_start))
        self.stages = list(STAGES)
        estimator, joints = sets["state_estimator"], len(scenario.arm_start)
        self.estimator = estimator_stage(estimator, joints, timing.control_period)
        start = StartParameters(auto_start=True)
        mission = Mission(scenario, sets["mission"], start, vehicle, compared=True)
        self.mission = MissionStage(mission, timing)
        self.position = LawStage(PositionController(sets["position_controller"]), timing)
        self.attitude = LawStage(AttitudeController(sets["attitude_controller"]), timing)
        self.measured_delay = MeasuredDelay(self.attitude.controller)
        self.arm = LawStage(ArmController(sets["arm_controller"]), timing)
        self.bridge = bridge
        self.level = np.zeros((3, 3))  # attitude reference while there is none
        self.laws: dict[str, LawStage] = {
            "position": self.position,
            "attitude": self.attitude,
            "arm": self.arm,
        }
        self.signals.arm_command = self.arm.controller.command
        self._told: tuple | None = None  # what the bridge has of the mission

    def tick(
        self,
        mocap: Pose | None = None,
        joints: Joints | None = None,
        imu: Imu | None = None,
        payload: Pose | None = None,
    ) -> bool:
        """Run one tick with the samples that have arrived; all stamps in [ns].

        Returns False without an IMU sample, or before every sensor has delivered one: the samples
        are stored, the other signals do not change.
        """
        signals = self.signals
        signals.mocap, signals.joints, signals.imu = mocap, joints, imu
        signals.payload = payload
        return self.go_on(0)

    def go_on(self, first: int) -> bool:
        """Run the stages from number `first` on; return whether the last one was reached."""
        for _, stage in self.stages[first:]:
            if not stage(self):
                return False
        return True

    def insert(self, before: str, name: str, stage: Stage) -> None:
        """Insert a stage before the stage `before`; raises ValueError if it does not exist."""
        names = [name for name, _ in self.stages]
        self.stages.insert(names.index(before), (name, stage))


Stage = Callable[[ControlTick], bool]  # returns whether the tick goes on


def listen(tick: ControlTick) -> bool:
    """mocap, joints, payload → the supervisor's inputs; mocap → the autopilot's estimator."""
    s, inputs = tick.signals, tick.mission.inputs
    if s.mocap is not None:
        inputs.keep("mocap", inputs.mocap, s.mocap)
        tick.bridge.mocap(*s.mocap)
    if s.joints is not None:
        inputs.keep("joints", inputs.joints, s.joints)
    if s.payload is not None:
        inputs.keep("payload", inputs.payload, s.payload)
    return True


def estimate(tick: ControlTick) -> bool:
    """mocap, joints, imu → state."""
    s, estimator = tick.signals, tick.estimator
    if s.mocap is not None:
        estimator.mocap(*s.mocap)
    if s.joints is not None:
        estimator.joints(*s.joints[:3])
    state = None if s.imu is None else estimator.imu(*s.imu)
    if state is None:
        return False
    s.stamp, s.state = estimator.stamp, state
    if estimator.bias_due:
        inputs = tick.mission.inputs
        message = s.stamp / SECOND, estimator.estimator.imu_bias[1]
        inputs.keep("IMU bias", inputs.inputs.accelerometer_bias, message, s.stamp)
    return True


def fly_mission(tick: ControlTick) -> bool:
    """state, the autopilot's last report → reference, flying, magnet; arming."""
    s, mission = tick.signals, tick.mission
    mission.begin(s.stamp, s.state)
    output = mission.output
    # a copy, as `look_ahead` writes the next one; on the ground only the arm has a reference
    if mission.flying:
        s.reference[:] = mission.reference
    else:
        s.reference[:, ARM] = mission.reference[:, ARM]
    s.flying, s.magnet = mission.flying, output.magnet
    s.time, s.phase = mission.time, output.phase
    told = output.arm, output.magnet, output.state is State.FAILSAFE, output.regains
    if told != tick._told:
        tick._told = told
        tick.bridge.arm(output.arm)
        tick.bridge.mission(s.stamp, *told[1:])
    return True


def control_position(tick: ControlTick) -> bool:
    """state, reference → tau_p, attitude reference."""
    s, stage = tick.signals, tick.position
    s.tau_p = stage.update(s.stamp, s.state, s.reference, s.flying)
    s.attitude_reference = stage.controller.attitude_reference if s.flying else tick.level
    if stage.gains_due:
        _keep_gains(tick, "position", stage)
    return True


def control_attitude(tick: ControlTick) -> bool:
    """state, reference, attitude reference → tau_q."""
    s, stage = tick.signals, tick.attitude
    tick.measured_delay.apply(s.stamp)
    s.tau_q = stage.update(s.stamp, s.state, s.reference, s.attitude_reference, s.flying)
    if stage.gains_due:
        _keep_gains(tick, "attitude", stage)
    return True


def control_arm(tick: ControlTick) -> bool:
    """state, reference, attitude reference → tau_alpha, command of the servos."""
    s, stage = tick.signals, tick.arm
    s.tau_alpha = stage.update(s.stamp, s.state, s.reference, s.attitude_reference, s.flying)
    if stage.gains_due:
        _keep_gains(tick, "arm", stage)
    return True


def send_setpoint(tick: ControlTick) -> bool:
    """state, laws → setpoint to the autopilot; the autopilot's report to the mission."""
    s, bridge = tick.signals, tick.bridge
    bridge.hear(s.stamp)
    bridge.note_state(s.stamp, s.state)
    tau_q = s.tau_q if s.flying else None
    reference = s.reference[:, POSITION]
    s.setpoint = bridge.tick(
        s.stamp, s.state, s.flying, s.tau_p, tau_q, s.attitude_reference, reference
    )
    s.thrust_factor, report = bridge.factor, bridge.report
    if bridge.lift_due:
        inputs = tick.mission.inputs
        inputs.keep("lift", inputs.inputs.lift, (bridge.lift,), s.stamp)
    if report is not None:
        take_report(tick, report)
    return True


def take_report(tick: ControlTick, report: AutopilotReport) -> None:
    """Give the bridge's report of the present tick to mission and attitude law."""
    stamp = tick.signals.stamp
    held = report.released_to, report.landed, report.lands, report.failed, report.stopped
    authority = Authority(*held)
    tick.mission.autopilot(
        stamp,
        report.connected,
        report.armed_since,
        report.round_trip,
        report.loop_delay,
        authority,
    )
    tick.measured_delay.report(stamp, report.loop_delay)


def look_ahead(tick: ControlTick) -> bool:
    """state → reference of the next tick."""
    tick.mission.advance(tick.signals.stamp, tick.signals.state)
    return True


def _keep_gains(tick: ControlTick, subsystem: str, stage: LawStage) -> None:
    """Adapted gains → the supervisor's inputs."""
    inputs, law = tick.mission.inputs, stage.controller
    stamp, gains = tick.signals.stamp, law.adaptation.copy()
    message = stamp / SECOND, subsystem, law.names, gains
    inputs.keep(subsystem, inputs.inputs.gains, message, stamp)


STAGES: Sequence[tuple[str, Stage]] = (
    ("listeners of the sensors", listen),
    ("estimator", estimate),
    ("mission", fly_mission),
    ("position law", control_position),
    ("attitude law", control_attitude),
    ("arm law", control_arm),
    ("bridge", send_setpoint),
    ("next reference", look_ahead),
)
