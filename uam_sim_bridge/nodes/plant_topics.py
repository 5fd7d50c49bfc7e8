"""The plant's side of the ROS topics: sensors and truth out, answers in."""

import time
from functools import partial

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64

from uam_control.stamps import nanoseconds
from uam_control.vehicle import (
    CURRENT_SERVO,
    POSITION_SERVO,
    TWO_FINGER,
    OpenEnd,
    VehicleDescription,
)
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import (
    GRIPPER,
    ImuWriter,
    JointStateWriter,
    PoseWriter,
    TrajectoryWriter,
    read_joint_command,
    read_switch,
)
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.messages.navigation import OdometryWriter
from uam_msgs_py.messages.serialized import Template
from uam_msgs_py.messages.status import MissionStatus
from uam_msgs_py.node.namespace import frame
from uam_msgs_py.node.rightful import RightfulNodes
from uam_msgs_py.node.tick_times import NoTickTimes
from uam_sim_bridge.plant import Samples, Truth


class Outlets:
    """Publishers by topic, without event callbacks, which would slow each wait of the executor."""

    def __init__(
        self,
        node: Node,
        chosen: tuple[topics.Topic, ...],
        times: NoTickTimes | None = None,
    ):
        """times: measures the publications."""
        events = PublisherEventCallbacks(use_default_callbacks=False)
        self.outlets: dict[str, Publisher] = {
            topic.name: topic.outlet(node, event_callbacks=events) for topic in chosen
        }
        for topic in chosen if times else ():
            times.watch(self.outlets[topic.name], topic)


class Sensors(Outlets):
    """Publishes /clock and the sensor samples."""

    def __init__(
        self,
        node: Node,
        vehicle: VehicleDescription,
        publish_imu: bool,
        times: NoTickTimes,
        odometry: bool = False,
    ):
        """publish_imu: whether the companion has an IMU of its own; times: see Outlets; odometry:
        whether the poses are those of one."""
        imu = (topics.IMU,) if publish_imu else ()
        poses = topics.ODOMETRY_IN if odometry else topics.MOCAP
        chosen = topics.CLOCK, topics.JOINTS, poses, topics.PAYLOAD, *imu
        super().__init__(node, chosen, times)
        self._clock, self._joints, self._mocap, self._payload, *self._imu = self.outlets.values()
        self._clock_writer = Template(Clock())
        body = frame(node, topics.BODY)
        self._imu_writer = ImuWriter(body)
        self._mocap_writer = OdometryWriter(body) if odometry else PoseWriter()
        self._payload_writer = PoseWriter()
        self._joint_writer = JointStateWriter([*vehicle.joint_names, *_fingers(vehicle)])
        self._period = nanoseconds(vehicle.control_period)

    def clock(self, stamp: int) -> None:
        """Publish simulation time [ns]."""
        self._clock.publish(self._clock_writer.stamped(stamp))

    def publish(self, samples: Samples) -> int | None:
        """Publish this tick's samples; return its stamp [ns], None if no own IMU sample starts it.

        The IMU's is published last: it starts the estimator's tick. The stamp of the tick is the
        IMU's without jitter, a multiple of the control period.
        """
        for exposed, *pose in samples.poses:
            self._mocap.publish(self._mocap_writer.fill(nanoseconds(exposed), *pose))
        if samples.payload is not None:
            time, *pose = samples.payload
            self._payload.publish(self._payload_writer.fill(nanoseconds(time), *pose))
        if samples.joints is not None:
            time, alpha, alpha_dot, torque = samples.joints
            writer = self._joint_writer
            n, grip = len(alpha), () if samples.grip is None else samples.grip[1]
            writer.position[:n], writer.velocity[:n], writer.effort[:n] = alpha, alpha_dot, torque
            if len(writer.position) > n:
                writer.position[n], writer.effort[n] = grip
            self._joints.publish(writer.stamped(nanoseconds(time)))
        if samples.imu is None or not self._imu:
            return None
        time, gyro, force = samples.imu
        stamp = nanoseconds(time)
        for _ in range(samples.imu_copies):
            self._imu[0].publish(self._imu_writer.fill(stamp, gyro, force))
        return round(stamp / self._period) * self._period


class TruthTopics(Outlets):
    """Publishes the true values of the simulation; no controller subscribes to them."""

    def __init__(self, node: Node, vehicle: VehicleDescription):
        truth = (topics.TRUTH_STATE, topics.TRUTH_PAYLOAD, topics.TRUTH_ROTORS, topics.TRUTH_MAGNET)
        super().__init__(node, truth)
        self._state, self._payload, self._rotors, self._magnet = self.outlets.values()
        self._state_writer = TrajectoryWriter(vehicle.coordinates)
        self._payload_writer = PoseWriter()
        self._rotor_writer = JointStateWriter(vehicle.rotor_names)
        self._magnet_writer = JointStateWriter(["magnet", "swing", *_fingers(vehicle)])

    def publish(self, stamp: int, truth: Truth, motors: np.ndarray, magnet: bool) -> None:
        """Publish the truth at `stamp` [ns], and the last commands; motors (rotors,): 0..1."""
        self.publish_state(stamp, truth)
        self._payload.publish(
            self._payload_writer.fill(stamp, truth.payload_position, truth.payload_quaternion)
        )
        rotors = self._rotor_writer
        rotors.position[:], rotors.velocity[:] = motors, truth.rotor_speed
        rotors.effort[:] = truth.rotor_thrust
        self._rotors.publish(rotors.stamped(stamp))
        writer = self._magnet_writer
        writer.position[:2] = magnet, truth.magnet_swing
        writer.effort[0] = truth.magnet_force
        if len(writer.position) > 2:
            writer.position[2], writer.effort[2] = truth.grip
        self._magnet.publish(writer.stamped(stamp))

    def publish_state(self, stamp: int, truth: Truth) -> None:
        """Publish the true state alone; `stamp` [ns]."""
        self._state.publish(self._state_writer.fill(stamp, truth.state))


def _fingers(vehicle: VehicleDescription) -> tuple[str, ...]:
    """Return the name of the fingers among joints, () without."""
    return (GRIPPER,) if vehicle.gripper.kind == TWO_FINGER else ()


class RecorderProgress:
    """Listens to the recorder. `until` [ns]: simulation time up to which the log is complete.

    A further recorder, under another name, is not waited for, and is no reason to complain.
    """

    def __init__(self, node: Node, rightful: RightfulNodes):
        self.until = 0
        topic = topics.RECORDED_UNTIL
        events = SubscriptionEventCallbacks(use_default_callbacks=False)
        inlet = node.create_subscription(
            topic.type, topic.name, self._on_progress, topic.qos, raw=True, event_callbacks=events
        )
        node.door.guard(inlet, topic.name, rightful, lambda: self.until > 0)

    def _on_progress(self, data: bytes) -> None:
        self.until = stamp_of(data)


SETPOINT, ARM, MAGNET = "setpoint", "arm command", "magnet command"  # the answers, in messages
# The node named when answers are missing: the last one that all of them depend on.
SUSPECTS = {
    frozenset({SETPOINT, ARM, MAGNET}): "state_estimator",
    frozenset({SETPOINT, ARM}): "position_controller or mission",
    frozenset({SETPOINT}): "attitude_controller or mavlink_bridge",
    frozenset({ARM}): "arm_controller",
    frozenset({MAGNET}): "mission",
}


def suspected(missing: frozenset[str]) -> str:
    """Return which node does not answer, for a text; missing: answers."""
    suspect = SUSPECTS.get(missing)
    return f"; {suspect} is silent" if suspect else ""


class Answers:
    """Answers of the nodes to a tick: setpoint sent, servo commands, magnet; state of the mission.

    `arm_command` (n,), see `Servos`, and `magnet` hold until the next valid message. `setpoints`:
    stamp [ns] → wall time [ns] of the bridge's publication; filled only by `take`, cleared after
    the measurement of the latency.
    """

    def __init__(
        self,
        node: Node,
        vehicle: VehicleDescription,
        rightful: RightfulNodes,
        servo_mode: str = CURRENT_SERVO,
    ):
        """servo_mode: of SERVO_MODES; only the commands of this mode are used."""
        self._names = list(vehicle.joint_names)
        self._door = node.door
        to_goals = servo_mode == POSITION_SERVO
        self._arm_topic = topics.ARM_GOALS if to_goals else topics.ARM_EFFORT
        # NaN: no goal yet, the servos hold their position
        self.arm_command = np.full(len(self._names), np.nan if to_goals else 0.0)
        self.magnet = False
        self.fingers = OpenEnd(vehicle.gripper.opening) if _fingers(vehicle) else None
        self.forget_mission()
        self.setpoints: dict[int, int] = {}
        self.arrivals: dict[str, float] = {}  # time.monotonic() of the newest, by topic
        self.restarts = 0  # of nodes that were lost
        self._arrived: set[str] = set()
        self._setpoint_stamp = -1
        # [ns] the stack's ticks may lie beside the plant's if an IMU with jitter started them
        self._tolerance = nanoseconds(vehicle.control_period) // 2

        events = SubscriptionEventCallbacks(use_default_callbacks=False)
        self.inlets: dict[str, Subscription] = {
            topic.name: node.create_subscription(
                topic.type, topic.name, callback, topic.reading, raw=raw, event_callbacks=events
            )
            for topic, callback, raw in (
                (topics.SETPOINT, self._on_setpoint, True),
                (topics.ARM_EFFORT, partial(self._on_arm, topics.ARM_EFFORT), True),
                (topics.ARM_GOALS, partial(self._on_arm, topics.ARM_GOALS), True),
                (topics.MAGNET, self._on_magnet, True),
                (topics.GRIPPER_COMMAND, self._on_gripper, False),
                (topics.MISSION_STATUS, self._on_mission, False),
                (topics.RESTARTS, self._on_restart, False),
            )
        }
        for name, inlet in self.inlets.items():
            self._door.guard(inlet, name, rightful, lambda: self.begun)

    def forget_mission(self) -> None:
        """Put the state of the mission back to that before its first message."""
        self.mission, self.mission_stamp = MissionStatus(), 0  # [ns]

    def begin(self) -> None:
        """Begin a tick: clear the set of received answers."""
        self._arrived.clear()

    def missing(self, stamp: int | None) -> frozenset[str]:
        """Return the missing answers to the tick of `stamp` [ns].

        stamp: None if the autopilot's IMU starts the ticks, by its own clock; a setpoint since
        `begin` is then the answer.
        """
        if stamp is None:
            return frozenset({ARM, MAGNET, SETPOINT} - self._arrived)
        lacking = {ARM, MAGNET} - self._arrived
        answered = self._setpoint_stamp >= stamp - self._tolerance
        return frozenset(lacking if answered else lacking | {SETPOINT})

    @property
    def begun(self) -> bool:
        """Whether a setpoint has arrived."""
        return self._setpoint_stamp >= 0

    def take(self) -> None:
        """Take every message in the queues, without waiting."""
        for subscription in self.inlets.values():
            for taken in self._door.taken(subscription):
                self._door.accepts(subscription, subscription.callback, *taken)

    def _on_setpoint(self, data: bytes, info: dict | None = None) -> None:
        self._setpoint_stamp = stamp_of(data)
        self._arrived.add(SETPOINT)
        self.arrivals[topics.SETPOINT.name] = time.monotonic()
        if info is not None:
            self.setpoints[self._setpoint_stamp] = info["source_timestamp"]

    def _on_arm(self, topic: topics.Topic, data: bytes, info: dict | None = None) -> None:
        if topic is self._arm_topic:
            self._arrived.add(ARM)
        command = read_joint_command(data, self._names)
        if topic is self._arm_topic:
            self.arm_command = command
            self.arrivals[topic.name] = time.monotonic()

    def _on_magnet(self, data: bytes, info: dict | None = None) -> None:
        self._arrived.add(MAGNET)
        self.magnet = read_switch(data)
        if self.fingers is not None:
            self.fingers.switch(self.magnet)
        self.arrivals[topics.MAGNET.name] = time.monotonic()

    def _on_gripper(self, message: Float64, info: dict | None = None) -> None:
        if self.fingers is not None:
            self.fingers.command(message.data)

    def _on_restart(self, message: DiagnosticArray, info: dict | None = None) -> None:
        self.restarts += 1

    def _on_mission(self, message: DiagnosticArray, info: dict | None = None) -> None:
        self.mission_stamp, self.mission = MissionStatus.from_message(message)
        self.arrivals[topics.MISSION_STATUS.name] = time.monotonic()
