"""Node: mission. state + autopilot → reference, magnet, arming."""

import math
import time
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Bool, Float64

from uam_control.coordinates import ARM, ATTITUDE, CHI
from uam_control.grasp import Grasp
from uam_control.laws.catalogue import DEFAULT
from uam_control.maths.rotations import tilt
from uam_control.mission import (
    ChecklistReport,
    Feasibility,
    InfeasibleReference,
    Mission,
    MissionParameters,
    Scenario,
    StartParameters,
)
from uam_control.nodes.described import (
    described_hand,
    described_scenario,
    described_timing,
    described_vehicle,
)
from uam_control.nodes.mission_errors import TrackingErrors
from uam_control.nodes.mission_inputs import MissionInputs, offer_commands
from uam_control.nodes.planner_inputs import PlannerInputs
from uam_control.profiles.profile import (
    BRIDGE,
    CONTROLLERS,
    Profile,
    default_profile,
    reference_limits,
)
from uam_control.settings.parameter_set import ParameterSet, number
from uam_control.stages.mission_stage import MissionStage
from uam_control.stamps import SECOND
from uam_control.supervision import Inputs, State
from uam_control.supervision.checks import margin_left
from uam_control.supervision.inputs import SUBSYSTEMS
from uam_control.supervision.states import STOPPED_STATES
from uam_control.vehicle import VehicleDescription, derived_parameters
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.checklist import preflight_message
from uam_msgs_py.messages.control import ReferenceWriter, read_state
from uam_msgs_py.messages.convert import SWITCH
from uam_msgs_py.messages.navigation import hand_message, path_message
from uam_msgs_py.messages.status import (
    ERROR,
    OK,
    WARN,
    AutopilotState,
    ChecklistState,
    MissionStatus,
)
from uam_msgs_py.node.base_node import UamNode, run
from uam_msgs_py.node.joins import Backlog
from uam_msgs_py.node.namespace import neighbour_section
from uam_msgs_py.node.node_parameters import NodeParameters
from uam_msgs_py.node.tick_times import DECODE, ENCODE, STAGE

NAME = "mission"
AXES = 3  # of position and attitude
STATUS_PERIOD = 500_000_000  # [ns]
PATH_STEP = 0.25  # [s] between two poses of the path
PATH_LENGTH = 250.0  # [s] of the flight in it: a tick must not wait for the path of hours
HAND_PERIOD = 20_000_000  # [ns] between two references of the end effector
WATCH_PERIOD = 0.05  # [s] of the watch on states


@dataclass(frozen=True)
class StateWatch(ParameterSet):
    """The reaction to states that stop; it cannot change while the node runs."""

    state_timeout: float = number(
        0.0,
        "time without a state in flight, on the wall clock, after which the autopilot's failsafe "
        "acts, 0: none, as in simulation",
        "s",
        0.0,
        10.0,
    )


OF_LAWS = ("inertia", "lambda_1", "lambda_2")  # on which limits of the reference depend


class MissionNode(UamNode):
    """For each state, publishes the reference of the next tick and the magnet of this tick.

    The reference goes out one tick ahead: when a state arrives, the controllers already have the
    reference of its tick.
    """

    def __init__(self):
        super().__init__(NAME)
        vehicle = described_vehicle(self)
        profile = default_profile(DEFAULT, vehicle)
        derived = derived_parameters(vehicle)[NAME] | self._reference_limits(profile, vehicle)
        axes = vehicle.coordinates[ARM]
        self.parameter_set = NodeParameters(
            self, MissionParameters, axes, profile.section(NAME), derived
        )
        timing = described_timing(self, vehicle)
        scenario = self._scenario(vehicle)
        start = NodeParameters(self, StartParameters, read_only=True).current
        self._has_clock = start.autopilot_has_clock
        self._mission = Mission(scenario, self.parameter_set.current, start, vehicle)
        self.stage = MissionStage(self._mission, timing)
        spare = Mission(self._mission.scenario, self.parameter_set.current)
        warm_up(spare, self.parameter_set.current.takeoff_delay, timing.control_period)
        self.parameter_set.apply = self._mission.configure
        self._arm: bool | None = None
        self._published: tuple = ()  # content of the last status
        self._due = 0  # stamp [ns] of the next status
        self._held_back = False  # whether a limit prevents the take-off
        self._states = Backlog()
        self._state_timeout = NodeParameters(self, StateWatch, read_only=True).current.state_timeout
        self._state_at = math.inf  # [s] time.monotonic() of the newest state
        if self._state_timeout:
            self.every(WATCH_PERIOD, self._watch_states)

        self._reference = self.publisher(topics.REFERENCE)
        self._magnet = self.publisher(topics.MAGNET)
        self._arming = self.publisher(topics.ARMING)
        self._status = self.publisher(topics.MISSION_STATUS)
        self._preflight = self.publisher(topics.PREFLIGHT)
        self._path = self.publisher(topics.PATH)
        self._hand = self.publisher(topics.END_EFFECTOR_REFERENCE)
        self._flyer, self._hand_due = described_hand(vehicle), 0  # [ns]
        self._gripper, self._gripper_due = self.publisher(topics.GRIPPER_STATE), 0
        self.listen(topics.GRIPPER_COMMAND, self._on_gripper, required=False)
        self._path_of = ""  # the plan that was published, see _publish_path
        self._joints = len(vehicle.joints)
        self._writer = ReferenceWriter(self._joints)
        self.errors = TrackingErrors(self)
        inputs = MissionInputs(self, self.stage.inputs, vehicle.joint_names)
        if inputs.poses.odometry:
            self._mission.use_odometry()
        self.listen(topics.AUTOPILOT_STATE, self._on_autopilot, required=False)
        if start.require_checklist:
            self.listen(topics.CHECKLIST, self._on_checklist, required=False)
        self.listen(topics.STATE, self._on_state)
        self.triggers = (topics.STATE.name,)
        offer_commands(self, self._mission)
        self._planners = PlannerInputs(
            *(self, self._mission, vehicle.joint_names, self._flyer),
            lambda: self._status.publish(self.status.to_message(self.stamp)),  # a planner waits
        )

    def _reference_limits(self, profile: Profile, vehicle: VehicleDescription) -> dict[str, float]:
        """Return those by position controller and bridge: of the parameter file, or `profile`."""
        bases = []
        for controller, (limits, _) in list(CONTROLLERS.items())[:2]:
            given = neighbour_section(self, controller)
            own = default_profile(given.get("law", DEFAULT), vehicle).sets[controller]
            names = set(own.specs()) & {*limits.specs(), *OF_LAWS} & set(given)
            bases.append(replace(own, **{name: given[name] for name in names}).validated(AXES))
        bridge = neighbour_section(self, BRIDGE) or profile.section(BRIDGE)
        return reference_limits(*bases, bridge)

    def _scenario(self, vehicle: VehicleDescription) -> Scenario:
        """Return the scenario, its ramps within the limits if they can be; with the parameter
        `retime` slowed down until it is feasible."""
        scenario = described_scenario(self, vehicle)
        check = Feasibility(vehicle, self.parameter_set.current, scenario.payload_mass)
        if not self.get_parameter("retime").value:
            return check.fitted(scenario)
        try:
            scenario, factor = check.retimed(scenario)
        except InfeasibleReference as error:
            self.get_logger().error(str(error))  # the pre-arm report has it, too
            return scenario
        self.get_logger().info(f"scenario {scenario.name}: {factor:.3g} times as slow")
        return scenario

    def _on_autopilot(self, message: DiagnosticArray) -> None:
        self.stage.autopilot(*AutopilotState.from_message(message))

    def _watch_states(self) -> None:
        """Give up in flight when no state comes: without one, no tick checks any limit."""
        silence = time.monotonic() - self._state_at
        if silence < self._state_timeout:
            return
        self._state_at = math.inf
        self._mission.lose_states(f"no state of the estimator for {silence:.2f} s: IMU lost?")
        self._publish_status(self.stamp + round(silence * SECOND))

    def _on_gripper(self, message: Float64) -> None:
        _, text = self._mission.command_gripper(message.data)
        self.get_logger().info(f"gripper {message.data:g}: {text}")

    def _on_checklist(self, message: DiagnosticArray) -> None:
        stamp, state = ChecklistState.from_message(message)
        report = ChecklistReport(stamp / SECOND, state.passed, state.failing, state.commands)
        self._mission.checklist(report)

    def _on_state(self, data: bytes) -> None:
        self._states.put(read_state(data, self._joints))

    def settle(self) -> None:
        for stamp, state in self._states.take():
            begun = time.perf_counter()
            self.times.lap(DECODE)
            self.note_time(stamp)
            self.stage.begin(stamp, state)
            self.times.lap(STAGE)
            self.tell(stamp, state)
            self.answer()
            self.times.lap(ENCODE)
            self.stage.advance(stamp, state)
            self.times.lap(STAGE)
            self.send()
            self.done_tick(stamp, begun)

    def note_time(self, stamp: int) -> None:
        """Compare the tick `stamp` [ns] that begins with the wall clock, if stamps are not its."""
        if self._has_clock:
            self.stage.inputs.inputs.wall_clock(stamp / SECOND, time.monotonic())

    def tell(self, stamp: int, state: np.ndarray) -> None:
        """Publish the status of the tick `stamp` [ns] that has begun, state (3, 6 + n).

        Before `answer`, so that the status of a tick arrives before the magnet.
        """
        self._state_at = time.monotonic()
        if self.stage.anew:
            self.send()
        self.errors.tick(stamp, state, self.stage.reference, self.stage.output.flying)
        self._publish_status(stamp)

    def answer(self) -> None:
        """Publish the magnet, for which the plant waits, and the state of the gripper."""
        self._magnet.publish(SWITCH[bool(self.stage.output.magnet)])
        if self.stage.ahead >= self._gripper_due and self._gripper.get_subscription_count():
            self._gripper_due = self.stage.ahead + HAND_PERIOD
            self._gripper.publish(Float64(data=self._mission.gripper_state))

    def send(self) -> None:
        """Publish the newest reference, with the stamp of its tick."""
        stage, output = self.stage, self.stage.output
        since_takeoff = max(0, round(output.time * SECOND))
        self._reference.publish(
            self._writer.fill(stage.ahead, output.reference, stage.flying, since_takeoff)
        )
        if stage.flying and self._flyer and not 0 < self._hand_due - stage.ahead <= HAND_PERIOD:
            self._hand_due = stage.ahead + HAND_PERIOD
            if self._hand.get_subscription_count():
                chi = output.reference[CHI]
                self._hand.publish(hand_message(stage.ahead, self._flyer.chain, chi))

    def _publish_status(self, stamp: int) -> None:
        """Publish arming when it changes, and the status when it changes and twice a second."""
        output = self._mission.output
        if output.arm != self._arm:
            self._arm = output.arm
            self._arming.publish(Bool(data=bool(output.arm)))
        magnet, regains = bool(output.magnet), output.regains
        self._log_held_back()
        decisions = len(self._mission.grasps)
        now = (output.phase, output.done, output.state, output.cause, magnet, regains, decisions)
        if now == self._published and 0 < self._due - stamp <= STATUS_PERIOD:
            return
        if now[:4] != self._published[:4]:
            self._log()
        if decisions and now[-1:] != self._published[-1:]:
            self._log_grasp()
        self._published, self._due = now, stamp + STATUS_PERIOD
        self._status.publish(self.status.to_message(stamp))
        self._publish_path(stamp)
        if output.time < 0.0 or output.done:
            self._preflight.publish(preflight_message(stamp, self._mission.preflight()))

    @property
    def status(self) -> MissionStatus:
        """Phase, errors and state of the mission at the newest tick."""
        output, errors = self._mission.output, self.errors.newest()
        late = self._mission.checks.setpoint_delay
        return MissionStatus(
            output.phase,
            self.stage.time,
            errors.position,
            errors.attitude,
            errors.arm,
            output.done,
            output.abort_reason,
            bool(output.magnet),
            output.state.value,
            output.cause,
            output.regains,
            tilt=errors.tilt,
            answers=self._planners.answers,
            answer=self._planners.answer,
            grasp=output.grasp.value,
            attempt=output.attempt,
            decisions=len(self._mission.grasps),
            grasp_text=output.grasp_text,
            delay=self._mission.delay,
            setpoint_delay=None if math.isnan(late) else late,
            delay_margin=self.parameter_set.current.delay_margin,
        )

    def _publish_path(self, stamp: int) -> None:
        """Publish the planned positions of the next PATH_LENGTH, if the topic has a subscriber.

        After a change, and once half of a path is flown.
        """
        part = int(2.0 * self.stage.time / PATH_LENGTH)
        mission = self._mission
        plan = f"{len(mission.changes)} {mission.plans_flown} {mission.output.state} {part}"
        if plan != self._path_of and self._path.get_subscription_count():
            self._path_of = plan
            stamps, chi = mission.preview(PATH_STEP, PATH_LENGTH)
            self._path.publish(path_message(stamp, np.rint(stamps * SECOND).astype(int), chi))

    def _log(self) -> None:
        output = self._mission.output
        text = f"{output.phase} at {output.time:.3f} s; {output.state.value}: {output.cause}"
        text += ", done" if output.done else ""
        self.note(text, bool(output.abort_reason) or output.state in STOPPED_STATES)

    def _log_held_back(self) -> None:
        """Log once which limit prevents the take-off, and that it does no longer."""
        beyond = self._mission.checks.beyond if self._mission.output.state is State.GROUNDED else ""
        if bool(beyond) is not self._held_back:
            self._held_back = bool(beyond)
            text = f"no take-off: {beyond}" if beyond else "no limit is exceeded any more"
            self.get_logger().info(text)

    def _log_grasp(self) -> None:
        output = self._mission.output
        text = f"payload {output.grasp.value}, approach {output.attempt}: {output.grasp_text}"
        self.note(text, output.grasp in (Grasp.GIVEN_UP, Grasp.LOST, Grasp.STUCK))

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        output, beyond = self._mission.output, self._mission.checks.beyond
        limits, delay = self.parameter_set.current, self._mission.checks.setpoint_delay
        slower, late = self.stage.inputs.readings.slower, ""
        if delay > limits.delay_warn * limits.delay_margin:
            share = 100.0 * margin_left(delay, limits)
            late = f"setpoints {1e3 * delay:.0f} ms late: {share:.0f} % of the delay margin left"
        level = WARN if beyond or output.state in STOPPED_STATES or late else OK
        if output.abort_reason:
            level = ERROR
        summary = output.abort_reason or beyond or late or output.phase
        values = {
            "mission time [s]": output.time,
            "state": output.state.value,
            "cause": output.cause,
            "beyond a limit": beyond,
            "payload": f"{output.grasp.value} {output.grasp_text}".strip(),
            "setpoint delay [ms]": "" if math.isnan(delay) else f"{1e3 * delay:.1f}",
            "delay margin [ms]": f"{1e3 * limits.delay_margin:.1f}",
            "real time factor": "" if math.isnan(slower) else f"{1.0 - slower:.2f}",
            "answer to the last goal or trajectory": self._planners.answer,
        }
        return level, summary, values


def warm_up(spare: Mission, takeoff: float, period: float) -> None:
    """Compile the functions of a flight with a spare mission.

    takeoff [s]: its take-off delay; period [s]: between two ticks. What a message holds cannot be
    written: for numba it is another type than the arrays of a mission.
    """
    state = np.zeros_like(spare.output.reference)
    for stamp in (0.0, takeoff, takeoff + period):
        spare.step(stamp, state, 0.0)
    received = np.zeros(2)
    received.flags.writeable = False
    Inputs(period).gains(0.0, SUBSYSTEMS[0], ("rho", "rho_dot"), received)
    tilt(state[CHI, ATTITUDE])
    path_message(0, np.zeros(1, dtype=int), state[:1])


main = partial(run, MissionNode, NAME)  # returns the exit status
