"""One control tick, from sensor samples to the autopilot's setpoint: all stages in order.

STAGES at the end of this file is the block diagram. The direct engine and the fused nodes call
`ControlTick.tick`. With separate nodes each stage runs in a node of its own, and the signals are
topics.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self

import numpy as np

from uam_control.control.controllers import ArmController, AttitudeController, PositionController
from uam_control.control.whole_body import whole_body_step as compute_whole_body
from uam_control.coordinates import ALPHA, ARM, POSITION
from uam_control.estimation.estimator import write_biases
from uam_control.estimation.pose_anchor import PoseAnchor, anchor
from uam_control.maths.compiled import borrowing, counts_references
from uam_control.maths.memory import put
from uam_control.mission import Mission, Scenario, StartParameters
from uam_control.mission.mission_output import HAND_CHECK
from uam_control.mission.payload_watch import due
from uam_control.settings.parameter_set import ParameterSet
from uam_control.stages import estimator_stage, mission_stage, supervisor_inputs
from uam_control.stages.autopilot_port import AutopilotReport
from uam_control.stages.bridge_stage import BridgeStage, sending
from uam_control.stages.estimator_stage import EstimatorStage
from uam_control.stages.law_stages import (
    HandStage,
    LawStage,
    MeasuredDelay,
    WholeBodyStage,
    arm_step,
    attitude_step,
    hand_step,
    position_step,
    whole_body_step,
)
from uam_control.stages.mission_stage import MissionStage
from uam_control.stages.signals import (
    GRIP,
    IMU,
    JOINTS,
    PAYLOAD,
    POSES,
    Grip,
    Imu,
    Joints,
    Pose,
    Signals,
)
from uam_control.stages.step import ASK, DECIDE, DONE, ENDED, Stage, Step
from uam_control.stages.supervisor_inputs import BIAS, GAINS, LIFT, keep, read_inputs
from uam_control.stages.tick_stamps import Timing
from uam_control.stages.vision_pacing import take_pose
from uam_control.stamps import SECOND
from uam_control.supervision import State
from uam_control.supervision.inputs import SUBSYSTEMS
from uam_control.vehicle import VehicleDescription


class ControlTick:
    """All stages in one process, and the `signals` between them.

    `stages`: STAGES, or with a law of the whole body WHOLE_BODY in place of MODULAR; further ones
    may be inserted before the first tick.
    """

    def __init__(
        self,
        estimator: EstimatorStage,
        mission: MissionStage,
        laws: Sequence[LawStage],
        hand: HandStage,
        bridge: BridgeStage,
        odometry: bool = False,
    ) -> None:
        """laws: of position, attitude and arm; hand: before that of the arm; odometry: whether the
        poses are those of one, whose jumps are taken out in the tick, see `PoseAnchor`."""
        self.anchor, self.odometry = PoseAnchor(), odometry
        self.estimator, self.mission = estimator, mission
        if odometry:
            estimator.estimator.use_odometry()
            mission.mission.use_odometry()
        self.hand, self.bridge = hand, bridge
        self.position, self.attitude, self.arm = laws
        whole = self.arm.controller.law.whole
        self.whole = WholeBodyStage(laws) if whole else None
        self.stages = [*SENSING, *((WHOLE_BODY,) if whole else MODULAR), *SENDING]
        self.measured_delay = MeasuredDelay(self.attitude.controller)
        self.laws = dict(zip(SUBSYSTEMS, laws, strict=True))
        laws = [one.controller.arrays.all for one in self.laws.values()]
        command, taus = self.arm.controller.command, tuple(one.tau for one in laws)
        self.signals = Signals.at_rest(self.estimator.state, command, taus)
        self.arrays = self.signals.arrays()
        self.biases = np.zeros((2, 3))
        names = [one.controller.names for one in self.laws.values()]
        joints = self.estimator.state.shape[1] - ALPHA
        self.mission.inputs.share(joints, names)
        self.told: tuple | None = None  # what the bridge has of the mission

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        sets: Mapping[str, ParameterSet],
        bridge: BridgeStage,
        timing: Timing,
        vehicle: VehicleDescription | None = None,
        odometry: bool = False,
    ) -> Self:
        """Return the tick of a flight that starts by itself; odometry: see `ControlTick`."""
        return cls(*cls.parts(scenario, sets, timing, vehicle), bridge, odometry)

    @staticmethod
    def parts(
        scenario: Scenario,
        sets: Mapping[str, ParameterSet],
        timing: Timing,
        vehicle: VehicleDescription | None = None,
    ) -> tuple[EstimatorStage, MissionStage, list[LawStage], HandStage]:
        """Return estimator, mission, laws and hand of a flight that starts by itself.

        sets: parameters by the names of the nodes, see `Profile.sets`; vehicle: whose limits the
        begin of the reference is compared with, if given.
        """
        estimator, joints = sets["state_estimator"], len(scenario.arm_start)
        start = StartParameters(auto_start=True)
        mission = Mission(scenario, sets["mission"], start, vehicle, compared=True)
        controllers = (
            PositionController(sets["position_controller"]),
            AttitudeController(sets["attitude_controller"]),
            ArmController(sets["arm_controller"]),
        )
        return (
            estimator_stage.estimator_stage(estimator, joints, timing.control_period),
            MissionStage(mission, timing),
            [LawStage(controller, timing) for controller in controllers],
            HandStage(sets["arm_controller"], timing.control_period, joints, vehicle),
        )

    def tick(
        self,
        mocap: Pose | None = None,
        joints: Joints | None = None,
        imu: Imu | None = None,
        payload: Pose | None = None,
        grip: Grip | None = None,
    ) -> bool:
        """Run one tick with the samples that have arrived; all stamps in [ns].

        Returns False without an IMU sample, or before every sensor has delivered one: the samples
        are stored, the other signals do not change.
        """
        signals = self.signals
        signals.poses = () if mocap is None else (mocap,)
        signals.joints, signals.imu = joints, imu
        signals.payload, signals.grip = payload, grip
        return self.go_on(0)

    def go_on(self, first: int) -> bool:
        """Run the stages from number `first` on; return whether the last one was reached."""
        return all(stage.run(self) for stage in self.stages[first:])

    def insert(
        self, before: str, name: str, run: Callable[[ControlTick], bool], **more: Any
    ) -> None:
        """Insert a stage before the stage `before`; raises ValueError if it does not exist.

        run, more: fields of the `Stage`.
        """
        names = [stage.name for stage in self.stages]
        self.stages.insert(names.index(before), Stage(name, run, **more))


def listen(tick: ControlTick) -> bool:
    """poses, joints, payload → the supervisor's inputs; poses → the autopilot's estimator."""
    s, inputs = tick.signals, tick.mission.inputs
    if tick.odometry:
        s.poses = [(stamp, *tick.anchor(stamp / SECOND, *pose)) for stamp, *pose in s.poses]
    for pose in s.poses:
        inputs.put(supervisor_inputs.MOCAP, *pose)
        tick.bridge.mocap(*pose)
    if s.joints is not None:
        inputs.put(supervisor_inputs.JOINTS, s.joints[0], s.joints[3])
    if s.payload is not None:
        inputs.put(supervisor_inputs.PAYLOAD, *s.payload[:2])
    if s.grip is not None:
        inputs.put(supervisor_inputs.GRIP, *s.grip)
    return True


def estimate(tick: ControlTick) -> bool:
    """poses, joints, imu → state."""
    s, estimator = tick.signals, tick.estimator
    for pose in s.poses:
        estimator.mocap(*pose)
    if s.joints is not None:
        estimator.joints(*s.joints[:3])
    state = None if s.imu is None else estimator.imu(*s.imu)
    if state is None:
        return False
    s.stamp, s.state = estimator.stamp, state
    if estimator.bias_due:
        tick.biases[:] = estimator.estimator.imu_bias
    return True


def fly_mission(tick: ControlTick) -> bool:
    """state, the autopilot's last report → reference, flying, magnet; arming."""
    s, mission = tick.signals, tick.mission
    mission.begin(s.stamp, s.state)
    if tick.estimator.bias_due:  # like every result of a tick, it is read at a later one
        mission.inputs.put(BIAS, s.stamp, tick.biases[1])
    output = mission.output
    # a copy, as `look_ahead` writes the next one; on the ground only the arm has a reference
    if mission.flying:
        s.reference[:] = mission.reference
    else:
        s.reference[:, ARM] = mission.reference[:, ARM]
    s.flying, s.magnet = mission.flying, output.magnet
    s.time, s.phase = mission.time, output.phase
    told = output.arm, output.magnet, output.state is State.FAILSAFE, output.regains
    if told != tick.told:
        tick.told = told
        tick.bridge.arm(output.arm)
        tick.bridge.mission(s.stamp, *told[1:])
    tick.bridge.hands = output.phase == HAND_CHECK
    return True


def control_position(tick: ControlTick) -> bool:
    """state, reference → tau_p, attitude reference."""
    s, stage = tick.signals, tick.position
    s.tau_p = stage.update(s.stamp, s.state, s.reference, s.flying)
    s.attitude_reference[:] = stage.controller.attitude_reference if s.flying else 0.0
    if stage.gains_due:
        tick.mission.inputs.put(GAINS, s.stamp, stage.controller.adaptation)
    return True


def control_attitude(tick: ControlTick) -> bool:
    """state, reference, attitude reference → tau_q."""
    s, stage = tick.signals, tick.attitude
    tick.measured_delay.apply(s.stamp)
    s.tau_q = stage.update(s.stamp, s.state, s.reference, s.attitude_reference, s.flying)
    if stage.gains_due:
        tick.mission.inputs.put(GAINS + 1, s.stamp, stage.controller.adaptation)
    return True


def steer_hand(tick: ControlTick) -> bool:
    """state, reference → reference of the arm law."""
    s = tick.signals
    tick.hand.update(s.state, s.reference, s.flying, tick.arm.controller.saturated)
    return True


def control_arm(tick: ControlTick) -> bool:
    """state, reference of `steer_hand`, attitude reference → tau_alpha, command of the servos."""
    s, stage, reference = tick.signals, tick.arm, tick.hand.arrays.reference
    s.tau_alpha = stage.update(s.stamp, s.state, reference, s.attitude_reference, s.flying)
    if stage.gains_due:
        tick.mission.inputs.put(GAINS + 2, s.stamp, stage.controller.adaptation)
    return True


def control_whole_body(tick: ControlTick) -> bool:
    """state, reference → what the stages MODULAR write, by one law in flight."""
    s, position = tick.signals, tick.position.controller
    if not s.flying:
        return all(stage.run(tick) for stage in MODULAR)
    tick.whole.update(s.stamp, s.state, s.reference)
    s.attitude_reference[:] = position.attitude_reference
    for number, stage in enumerate(tick.laws.values()):
        if stage.gains_due:
            tick.mission.inputs.put(GAINS + number, s.stamp, stage.controller.adaptation)
    return True


def send_setpoint(tick: ControlTick) -> bool:
    """state, laws → setpoint to the autopilot; the autopilot's report to the mission."""
    s, bridge = tick.signals, tick.bridge
    bridge.hear(s.stamp, s.late)
    bridge.note_state(s.stamp, s.state)
    tau_q = s.tau_q if s.flying else None
    reference = s.reference[:, POSITION]
    s.setpoint = bridge.tick(
        s.stamp, s.state, s.flying, s.tau_p, tau_q, s.attitude_reference, reference
    )
    if bridge.lift_due:
        tick.mission.inputs.put(LIFT, s.stamp, bridge.lift)
    if bridge.report is not None:
        take_report(tick, bridge.report)
    return True


def take_report(tick: ControlTick, report: AutopilotReport) -> None:
    """Give the bridge's report of the present tick to mission and attitude law."""
    stamp = tick.signals.stamp
    tick.mission.autopilot(stamp, report)
    tick.measured_delay.report(stamp, report.loop_delay)


def look_ahead(tick: ControlTick) -> bool:
    """state → reference of the next tick."""
    tick.mission.advance(tick.signals.stamp, tick.signals.state)
    return True


@borrowing
def listen_step(a: tuple) -> int:
    """See `listen`, of an armed vehicle."""
    s, vision, seen, inputs, anchored, odometry = a
    for i in range(POSES):
        stamp, pose = s.exposed[i], s.poses[i]
        if stamp < 0:
            break
        exposed = stamp / SECOND
        if odometry:
            anchor(anchored, exposed, pose)
        if take_pose(vision, exposed, pose[:3], pose[3:], True):
            seen[0] = exposed
            put(pose[3:], seen[1:])
        keep(inputs, supervisor_inputs.MOCAP, stamp, pose)
    if s.stamps[JOINTS] >= 0:
        keep(inputs, supervisor_inputs.JOINTS, s.stamps[JOINTS], s.joints[2])
    if s.stamps[PAYLOAD] >= 0:
        keep(inputs, supervisor_inputs.PAYLOAD, s.stamps[PAYLOAD], s.payload)
    if s.stamps[GRIP] >= 0:
        keep(inputs, supervisor_inputs.GRIP, s.stamps[GRIP], s.grip)
    return DONE


@borrowing
def estimate_step(a: tuple) -> int:
    """See `estimate`."""
    s, estimator, biases = a
    for i in range(POSES):
        stamp, pose = s.exposed[i], s.poses[i]
        if stamp < 0:
            break
        estimator_stage.take_pose(estimator, stamp, pose[:3], pose[3:])
    if s.stamps[JOINTS] >= 0:
        estimator_stage.take_readings(estimator, s.stamps[JOINTS], s.joints[0], s.joints[1])
    stamp = s.stamps[IMU]
    if stamp < 0:
        return ENDED
    if estimator_stage.take_sample(estimator, stamp, s.imu[0], s.imu[1]) != estimator_stage.STATE:
        return ENDED
    s.numbers[0].stamp = estimator.ticks[0].stamp
    if estimator.numbers[0].bias_due:
        write_biases(estimator.estimator.pose.memory, biases)
    return DONE


@borrowing
def mission_step(a: tuple) -> int:
    """See `fly_mission`."""
    s, estimator, biases, inputs, mission = a
    m = s.numbers[0]
    if m.stamp != mission.numbers[0].ahead:
        return DECIDE
    read_inputs(inputs, m.stamp)
    if estimator[0].bias_due:
        keep(inputs, supervisor_inputs.BIAS, m.stamp, biases[1])
    mission_stage.begin_tick(mission, m.stamp)
    for row in range(len(s.reference)):
        put(mission.mission.guidance.reference[row], s.reference[row])
    m.time = mission.numbers[0].time
    return DONE


@borrowing
def look_ahead_step(a: tuple) -> int:
    """See `look_ahead`."""
    s, inputs, mission = a
    if not mission_stage.advance(mission, inputs.inputs.known, s.numbers[0].stamp, s.state):
        return DECIDE
    flown = mission.mission
    time = flown.guidance.numbers[0].scenario_time
    return ASK if due(flown.watch, flown.numbers[0].stamp, time) else DONE


def _step(function: Callable, arrays: Callable[[ControlTick], tuple]) -> Callable:
    """Return what makes the step of a tick: `function`, with these arrays."""
    return lambda tick: Step(function, (tick.arrays, *arrays(tick)))


def _law_step(make: Callable[[Callable], Callable], law: str) -> Callable:
    """Return what makes the step of one of the laws: make(its own)."""

    def step(tick: ControlTick) -> Step | None:
        stage, further = tick.laws[law], ()
        own, inputs = stage.controller.law, tick.mission.inputs.arrays
        if stage is tick.attitude:
            further = tick.measured_delay.arrays
        elif stage is tick.arm:
            further = (tick.hand.arrays.reference,)
        arrays = tick.arrays, stage.controller.arrays, own.arrays, stage.memory, inputs, *further
        compute = type(own).step
        return Step(make(compute), arrays) if counts_references(compute) else None

    return step


def _whole_body_step(tick: ControlTick) -> Step:
    arrays = tick.arrays, tick.whole.arrays, tick.mission.inputs.arrays
    return Step(whole_body_step(compute_whole_body), arrays)


def _bridge_step(tick: ControlTick) -> Step | None:
    bridge, port = tick.bridge, tick.bridge.autopilot
    if not bridge.compiled or port.steps is None:
        return None
    arrays = tick.arrays, bridge.arrays, port.arrays, tick.mission.inputs.arrays
    return Step(sending(port.steps), arrays)


def _listen_step(tick: ControlTick) -> Step | None:
    if tick.odometry and type(tick.estimator) is not EstimatorStage:
        return None  # a stage in Python has the poses of the stage before it in Python
    bridge, inputs = tick.bridge, tick.mission.inputs
    arrays = bridge.vision.arrays, bridge.source.seen, inputs.arrays, tick.anchor.arrays
    return Step(listen_step, (tick.arrays, *arrays, tick.odometry))


def _estimate_step(tick: ControlTick) -> Step | None:
    if type(tick.estimator) is not EstimatorStage:
        return None
    return Step(estimate_step, (tick.arrays, tick.estimator.arrays, tick.biases))


def _ahead(tick: ControlTick) -> tuple:
    return tick.mission.inputs.arrays, tick.mission.arrays


def _flown(tick: ControlTick) -> tuple:
    return tick.estimator.memory, tick.biases, *_ahead(tick)


def _steered(tick: ControlTick) -> tuple:
    return tick.hand.arrays, tick.arm.controller.memory


SENSING = (
    Stage("listeners of the sensors", listen, _listen_step),
    Stage("estimator", estimate, _estimate_step, decides=False),
    Stage("mission", fly_mission, _step(mission_step, _flown)),
)
MODULAR = (
    Stage("position law", control_position, _law_step(position_step, "position"), decides=False),
    Stage("attitude law", control_attitude, _law_step(attitude_step, "attitude"), decides=False),
    Stage("hand", steer_hand, _step(hand_step, _steered), decides=False),
    Stage("arm law", control_arm, _law_step(arm_step, "arm"), decides=False),
)
WHOLE_BODY = Stage("whole body", control_whole_body, _whole_body_step, decides=False)
SENDING = (
    Stage("bridge", send_setpoint, _bridge_step),
    Stage("next reference", look_ahead, _step(look_ahead_step, _ahead)),
)
STAGES: Sequence[Stage] = (*SENSING, *MODULAR, *SENDING)
