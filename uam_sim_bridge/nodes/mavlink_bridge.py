"""Node: tau_p and tau_q → SET_ATTITUDE_TARGET; OFFBOARD, arming, vision and telemetry over MAVLink.

The node runs one tick of `BridgeStage` for each stamp with state, position command and attitude
command. /uam/setpoint repeats the setpoint that was sent and acknowledges the tick.

After `stale_after` without commands (by the stamps of the state, in real time also by the wall
clock) the node runs `BridgeStage.without`.
"""

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from uam_control.mission.mission_output import HAND_CHECK
from uam_control.nodes.described import described_vehicle
from uam_control.nodes.pose_source import PoseSource
from uam_control.offboard.offboard_parameters import OffboardParameters
from uam_control.offboard.sequence import OffboardSequence
from uam_control.setpoints.level_hold import HoldParameters
from uam_control.setpoints.loop_delay import pause
from uam_control.setpoints.rate_thrust_map import RateThrustMap, RateThrustParameters
from uam_control.setpoints.setpoint_source import Setpoint, sent
from uam_control.setpoints.setpoint_types import SETPOINTS, SetpointParameters
from uam_control.setpoints.targets import Desired, VisionPose
from uam_control.setpoints.thrust_identification import ThrustIdentificationParameters
from uam_control.settings.parameter_set import ParameterError
from uam_control.stages.bridge_stage import BridgeSets, BridgeStage
from uam_control.stages.flight_measurements import FlightMeasurements, Sent
from uam_control.stages.vision_pacing import VisionParameters
from uam_control.stamps import SECOND
from uam_control.supervision import State
from uam_control.supervision.inputs import Waited
from uam_control.vehicle import derived_parameters
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import read_position_command, read_state, read_torque
from uam_msgs_py.messages.convert import JointStateWriter, SetpointWriter
from uam_msgs_py.messages.layouts import BadMessage, stamp_of
from uam_msgs_py.messages.status import ERROR, OK, WARN, MissionStatus
from uam_msgs_py.node.base_node import UamNode, run
from uam_msgs_py.node.joins import StampJoin
from uam_msgs_py.node.namespace import frame
from uam_msgs_py.node.node_parameters import NodeParameters
from uam_msgs_py.node.tick_times import DECODE, STAGE
from uam_sim_bridge.mavlink.protocol.setpoint_messages import vision_message
from uam_sim_bridge.mavlink.telemetry.parameter_check import adopted, differences
from uam_sim_bridge.nodes.autopilot_topics import WAKE_UP as IMU_WAKE_UP
from uam_sim_bridge.nodes.autopilot_topics import AutopilotImuTopic, AutopilotTopics, CompanionClock
from uam_sim_bridge.nodes.bridge_link import bridge_magnet, open_links
from uam_sim_bridge.nodes.bridge_parameters import BridgeParameters
from uam_sim_bridge.nodes.fault_topic import FaultTopic

NAME = "mavlink_bridge"
LATENCY = 0.05  # s, latency of sensors: a state or pose may be `stale_after` + LATENCY old
BAD = object()  # in place of an invalid message
WATCH_PERIOD = 0.02  # s, period of the real-time watchdog and of its setpoints


class MavlinkBridgeNode(UamNode):
    """Publishes /uam/setpoint, /uam/thrust, /uam/autopilot/state and /uam/autopilot/battery."""

    def __init__(self) -> None:
        super().__init__(NAME)
        vehicle = self._vehicle = described_vehicle(self)
        derived = derived_parameters(vehicle)[NAME]
        mapping = NodeParameters(self, RateThrustParameters, derived=derived)
        mapping.apply = self._configure
        self._options = NodeParameters(self, BridgeParameters, read_only=True).current
        vision = NodeParameters(self, VisionParameters, read_only=True).current
        offboard = NodeParameters(self, OffboardParameters, read_only=True).current
        hold = NodeParameters(self, HoldParameters, read_only=True).current
        setpoint = NodeParameters(self, SetpointParameters, read_only=True).current
        thrust = NodeParameters(self, ThrustIdentificationParameters, derived=derived)

        options, sequence = self._options, OffboardSequence(offboard)
        own_imu, self._imu = (), None
        if options.imu_source == "autopilot":
            clock = CompanionClock(self, options.imu_clock == "topic")
            own_imu = 1.0 / vehicle.control_period, clock.now
            self.wake_up = IMU_WAKE_UP
        links = open_links(options, sequence, mapping.current, *own_imu)
        self.link, self._station, self._faulty = links
        # whether the link is served before the first tick
        self._early = options.wait_for_device and not own_imu
        sets = BridgeSets(mapping.current, hold, thrust.current, vision, setpoint)
        fresh = options.stale_after + LATENCY
        self.stage = BridgeStage(
            sets, vehicle, self.link, sequence, fresh, self.warn, options.dry_run
        )
        thrust.apply = self.stage.identification.configure
        if own_imu:
            self._imu = AutopilotImuTopic(self, self.link, clock)
        self._magnet = bridge_magnet(self, self.link)
        self._fault_topic = FaultTopic(self) if options.faults else None
        self._adopted: tuple[str, ...] = ()
        self._commanded = 0  # stamp [ns] of the last tick with commands
        self._last_tick = time.monotonic()
        self._waited = Waited()
        self._warm_up()

        self._setpoint = self.publisher(topics.SETPOINT)
        self._autopilot = AutopilotTopics(self, self.link)
        self._thrust = self.publisher(topics.THRUST)
        self._writer = SetpointWriter(frame(self, topics.BODY))
        self._factor_writer = JointStateWriter(["factor"])
        names = [t.name for t in (topics.STATE, topics.POSITION_COMMAND, topics.ATTITUDE_COMMAND)]
        self._join = StampJoin(names, self._tick)
        self.joins.append(self._join)
        self._arming = self.listen(topics.ARMING, lambda m: self.stage.arm(m.data), required=False)
        self._poses = PoseSource(self)
        self._mocap = self.listen(
            self._poses.topic, lambda message: self.stage.mocap(*self._poses.read(message))
        )
        self._mission = self.listen(topics.MISSION_STATUS, self._on_mission, required=False)
        self._feed(topics.STATE, self._read_state)
        self._feed(topics.POSITION_COMMAND, read_position_command)
        self._feed(topics.ATTITUDE_COMMAND, self._read_attitude_command)
        self.triggers = (topics.ATTITUDE_COMMAND.name,)
        self._kill_until = -math.inf  # [s] wall time
        self.create_service(Trigger, "mission/kill", self._on_kill)
        if options.clock == "realtime":
            self.every(WATCH_PERIOD, self._watch)

    def _configure(self, parameters: RateThrustParameters) -> None:
        self.stage.map.configure(parameters)
        self.link.parameters.set_mapping(parameters)

    def destroy_node(self) -> None:
        if hasattr(self, "link"):
            if getattr(self, "_magnet", None) is not None:
                self._magnet.end(self.stamp / SECOND)
            self.link.close()
        super().destroy_node()

    def _feed(self, topic: topics.Topic, read: Callable[[bytes], tuple[int, object]]) -> None:
        """Join a topic; an invalid message still counts for its stamp, as BAD."""

        def handle(data: bytes) -> None:
            try:
                stamp, value = read(data)
            except BadMessage:
                self._join.add(topic.name, stamp_of(data), BAD)
                raise
            self._join.add(topic.name, stamp, value)

        self.listen(topic, handle)

    def _read_state(self, data: bytes) -> tuple[int, np.ndarray]:
        stamp, state = read_state(data, len(self._vehicle.joints))
        self.stage.note_state(stamp, state)
        return stamp, state

    @staticmethod
    def _read_attitude_command(data: bytes) -> tuple[int, tuple[np.ndarray | None]]:
        stamp, torque = read_torque(data)
        return stamp, (torque,)  # in a tuple: a torque None is "idle", for the join "missing"

    def _on_mission(self, message: DiagnosticArray) -> None:
        stamp, status = MissionStatus.from_message(message)
        failsafe = status.state == State.FAILSAFE.value
        self.stage.mission(stamp, status.magnet, failsafe, status.regains)
        self.stage.hands = status.phase == HAND_CHECK
        self.note_mission(stamp, status.time, status.phase)

    def note_mission(self, stamp: int, time: float, phase: str) -> None:
        """Note mission time [s] and phase at `stamp` [ns], by which faults of the link begin."""
        if self._faulty is not None:
            self._faulty.timeline.mission_at(stamp / SECOND, time, phase)

    def _on_kill(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Stop the motors at the second call within kill_confirmation."""
        now = time.monotonic()
        response.success = now <= self._kill_until
        if response.success:
            self.link.kill()
            response.message = "motors stop"
        else:
            self._kill_until = now + self._options.kill_confirmation
            response.message = (
                "the motors stop, in the air too: call again within "
                f"{self._options.kill_confirmation:g} s"
            )
        self.get_logger().warning(f"command kill: {response.message}")
        return response

    def _tick(self, stamp: int, state: Any, position: Any, torque: Any) -> None:
        """Run a tick; state (3, 6 + n), PositionCommand, (tau_q (3,) or None,), or BAD."""
        begun = time.perf_counter()
        self._commanded = stamp
        self.take_waiting(self._arming)
        self.take_waiting(self._mocap)
        self.take_waiting(self._mission)
        self.times.lap(DECODE)
        self.stage.hear(stamp, self.begin_tick(stamp))
        if state is BAD or position is BAD or torque is BAD:
            setpoint = self.stage.without(stamp)
        else:
            setpoint = self.stage.tick(
                stamp,
                state,
                position.flying,
                position.tau,
                *torque,
                position.attitude,
                position.reference,
            )
        self.times.lap(STAGE)
        self.send(stamp)  # before the plant goes on
        self.answer(stamp, setpoint)
        self.done_tick(stamp, begun)

    def begin_tick(self, stamp: int) -> float:
        """Begin the tick `stamp` [ns] with what is not of its stage: link and magnet.

        Returns for how long [s] it has waited, by the wall clock; 0 in lockstep.
        """
        self._last_tick = time.monotonic()
        late = 0.0
        if self._options.clock == "realtime":
            late = self._waited.late(stamp / SECOND, self._last_tick)
        self._begin_link(stamp)
        return late

    def _begin_link(self, stamp: int) -> None:
        changed = self._faulty.update(stamp / SECOND) if self._faulty else ()
        if self._fault_topic:
            self._fault_topic.publish(stamp, changed)
        self._adopt()
        if self._magnet is not None:
            self._magnet.update(stamp / SECOND)

    def answer(self, stamp: int, setpoint: Setpoint) -> None:
        """Publish the setpoint of the tick `stamp` [ns] as it was sent: the plant waits for it."""
        self._setpoint.publish(self._writer.fill(stamp, *sent(setpoint)))

    def send(self, stamp: int) -> None:
        """End the tick `stamp` [ns]: forward the ground station's messages, publish the autopilot's
        state, and thrust factor and lift if they are due."""
        self._end_link(stamp)
        if self.stage.lift_due:
            self._factor_writer.position[0] = self.stage.factor
            self._factor_writer.effort[0], self._factor_writer.velocity[0] = self.stage.lift
            self._thrust.publish(self._factor_writer.stamped(stamp))

    def _end_link(self, stamp: int) -> None:
        self._forward()
        self._autopilot.publish(stamp, self.stage.report)

    def _forward(self) -> None:
        """Forward the ground station's messages, if there is one."""
        if self._station is not None:
            self._station.forward()

    def _adopt(self) -> None:
        """Adopt the autopilot's parameters if `autopilot_parameters` is adopt; not while armed."""
        link = self.link
        adopting = self._options.autopilot_parameters == "adopt"
        if not adopting or link.armed or not link.parameters.mapping_read:
            return
        old = self.stage.map.parameters
        changes = tuple(differences(old, link.parameters.values, link.sequence.firmware))
        if not changes or changes == self._adopted:
            return
        self._adopted = changes
        try:
            new = adopted(old, link.parameters.values, link.sequence.firmware)
        except ParameterError as error:
            self.get_logger().warning(f"the autopilot's parameters are not adopted: {error}")
            return
        names = ("rate_p", "rate_k", "thr_mdl_fac")
        taken = [Parameter(name, value=_plain(getattr(new, name))) for name in names]
        self.change_parameters(taken, "autopilot")
        for change in changes:
            self.get_logger().info(f"adopted from the autopilot: {change}")

    def settle(self) -> None:
        """Run ticks with complete inputs, and ticks without commands after `stale_after`."""
        super().settle()
        if self._imu is not None:
            self._imu.serve(self.stamp if self.ticks else None)
        state = self._join.last_seen[topics.STATE.name]
        if self.ticks == 0 or state is None or state <= self.stamp:
            return
        if (state - self._commanded) / SECOND >= self._options.stale_after:
            self._join.skip(state)
            self.answer(state, self._go_without(state, self.begin_tick(state)))
            self.done_tick(state, time.perf_counter())

    def _watch(self) -> None:
        """Run ticks without commands in real time when states stop arriving.

        With `wait_for_device` the link is served before the first tick, too: the autopilot of a
        vehicle may be there before the sensors. Stamps are those of the system's clock then.
        """
        silence = time.monotonic() - self._last_tick
        if self.ticks == 0 and self._early:
            now = time.time()
            self.link.poll(now)
            self.link.maintain(now)
        if self.ticks == 0:  # a command that waited for the first tick would act much later
            self._forward()
        if self.ticks == 0 or silence < self._options.stale_after:
            return
        stamp = self.stamp + round(silence * SECOND)
        self._begin_link(stamp)
        self._go_without(stamp)

    def _go_without(self, stamp: int, late: float = 0.0) -> Setpoint:
        """End a tick at `stamp` [ns] without commands, which has begun; return the setpoint."""
        self.stage.hear(stamp, late)
        setpoint = self.stage.without(stamp)
        self._end_link(stamp)
        return setpoint

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        link, sequence = self.link, self.stage.sequence
        magnet = self._magnet
        notes = (*sequence.reasons, *link.faults(), *link.warnings)
        notes += () if magnet is None else magnet.problems()
        if refused := self.stage.source.refused:
            notes += (f"setpoint refused: {refused}",)
        values = {
            "sequence": sequence.phase.value,
            "in control": sequence.in_control,
            "autopilot mode": link.mode.name,
            "armed": link.armed,
            "landed": link.landed,
            "messages of other systems": link.ignored,
            "other autopilots": ", ".join(map(str, sorted(link.foreign))),
            "refused": link.codec.refused,
            "heartbeat": link.alive,
            "link open": link.transport.connected,
            "frames dropped": link.transport.dropped,
            "ground station held back": self._station.held_back if self._station else None,
            "level hold": self.stage.source.hold.active,
            "adopted": "; ".join(self._adopted),
            **link.values(),
            **({} if self._imu is None else self._imu.values()),
            **({} if magnet is None else magnet.values()),
            "loop delay [ms]": _text(1e3 * self.stage.loop_delay.value, ".1f"),
            "loop delay, explained [1]": f"{self.stage.loop_delay.explained:.2f}",
            "thrust factor [1]": f"{self.stage.map.thrust_factor:.4f}",
        }
        summary = "; ".join((sequence.phase.value, *notes))
        level = WARN if notes else OK
        return ERROR if sequence.failure else level, summary, values

    def _warm_up(self) -> None:
        """Compile the functions of a tick before the flight: a first call takes a second."""
        spare, zero, level = RateThrustMap(), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        state = np.zeros((3, len(self._vehicle.coordinates)))
        spare.map(zero, zero, zero, zero)
        for setpoint in SETPOINTS.values():
            setpoint(Desired(zero, np.zeros((3, 3)), 0.5))
        measured = FlightMeasurements(
            ThrustIdentificationParameters.of(self._vehicle), self._vehicle
        )
        measured.update(0.0, 0.004, state, Sent(zero, 0.5, True, False, 1.0), spare.curve)
        pause(measured.loop_delay.sums)
        vision_message(VisionPose(0.0, zero, level, 1.0, 1.0))


def _text(value: float, form: str) -> str:
    """Return the value as text, "" if it is unknown."""
    return "" if math.isnan(value) else format(value, form)


def _plain(value: float | tuple[float, ...]) -> float | list[float]:
    """Return the value in a type that ROS parameters accept."""
    return list(value) if isinstance(value, tuple) else value


def main() -> int:
    return run(MavlinkBridgeNode, NAME)
