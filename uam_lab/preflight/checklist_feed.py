"""What the checklist reads of a vehicle: polled topics → observation and samples."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from rclpy.subscription import Subscription

from uam_control.stamps import SECOND
from uam_control.vehicle import VehicleDescription
from uam_lab.flights.vehicle.checklist_parameters import ChecklistParameters
from uam_lab.preflight.checklist.host import HostReader
from uam_lab.preflight.checklist.observation import (
    BAD,
    GOOD,
    WARNING,
    GyroIntegral,
    NodeReport,
    Observation,
    Resting,
    Sample,
    Stream,
    Window,
)
from uam_lab.preflight.checklist.step import Situation
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.checklist import read_checks
from uam_msgs_py.messages.convert import read_imu, read_joints, read_pose
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.parameter_comparison import ParameterComparison
from uam_msgs_py.messages.serialized import Serialized
from uam_msgs_py.messages.status import OK, WARN, AutopilotState, RadioState, finite
from uam_msgs_py.node.door import Door
from uam_msgs_py.node.namespace import unlabelled
from uam_msgs_py.node.rightful import RightfulNodes

Readers = dict[topics.Topic, Callable[[Any], None]]
LEVELS = {OK: GOOD, WARN: WARNING}
SILENCE = 1.0  # [s] wall time without stamps from which on the vehicle's time goes on by itself
HOST_PERIOD = 2.0  # [s] wall time between two readings of the computer
POSE_AGE = "pose age at arrival, mean [ms]"  # in the diagnostics of the estimator


class Feed:
    """Polls the topics through `node`, which is not spun.

    `observation`: what the automatic items look at.
    """

    def __init__(
        self,
        node: Node,
        rightful: RightfulNodes,
        vehicle: VehicleDescription,
        observation: Observation,
        host: HostReader,
        limits: Callable[[], ChecklistParameters],
    ) -> None:
        self._node, self._rightful, self._limits = node, rightful, limits
        self._names = list(vehicle.joint_names)
        self.observation, self._host = observation, host
        self._streams = {topic: Stream() for topic in (topics.IMU, topics.JOINTS, topics.MOCAP)}
        self._gyro = GyroIntegral()
        self._window = Window(limits().rest_time)
        self._stamp, self._arrival = 0.0, time.monotonic()  # newest IMU stamp [s]
        self._pose: tuple[np.ndarray, np.ndarray] | None = None
        self._joints: np.ndarray | None = None
        self._inertial: list[tuple[np.ndarray, np.ndarray]] = []  # since the last sample
        self._commanded = np.zeros(3)
        self._magnet: bool | None = None
        self._heard: dict[str, float] = {}  # time.monotonic() of each node's diagnostics
        self._host_due = 0.0
        # of every tick: not read in flight, to save processor time
        self._fast: Readers = {
            topics.IMU: self._on_imu,
            topics.JOINTS: self._on_joints,
            topics.MOCAP: self._on_mocap,
            topics.SETPOINT: self._on_setpoint,
        }
        self._slow: Readers = {
            topics.AUTOPILOT_STATE: self._on_autopilot,
            topics.AUTOPILOT_BATTERY: self._on_battery,
            topics.ARM_TEMPERATURE: self._on_temperature,
            topics.MAGNET_STATE: self._on_magnet,
            topics.PREFLIGHT: self._on_preflight,
            topics.DIAGNOSTICS: self._on_diagnostics,
        }
        self.door = Door(node)
        self._subscriptions = {one: self._listen(one) for one in (*self._fast, *self._slow)}

    def _listen(self, topic: topics.Topic) -> Subscription:
        fast = topic in self._fast
        qos = topic.reading if fast else topic.qos
        return self.door.listen(topic, qos, fast, self._rightful, lambda: self._stamp > 0.0)

    @property
    def now(self) -> float:
        """Return the vehicle's time [s]: the newest stamp, carried on when stamps stop."""
        return self._stamp + max(0.0, time.monotonic() - self._arrival - SILENCE)

    def look(self) -> Situation:
        """Take all new messages; return what the steps look at."""
        seen = self.observation
        self._take(self._slow)
        if not seen.armed:
            self._take(self._fast)
        sample, rest_time = self._sample(), self._limits().rest_time
        self._window.span = rest_time
        if sample is not None:
            self._window.add(sample)
        now = self.now
        seen.imu, seen.joint_states, seen.mocap = (
            self._streams[topic].report(now) for topic in (topics.IMU, topics.JOINTS, topics.MOCAP)
        )
        rest = self._window.last(rest_time)
        still_there = time.monotonic() - self._arrival < SILENCE
        seen.resting = Resting.of(rest) if rest and still_there else None
        for name, heard in self._heard.items():
            seen.nodes[name] = seen.nodes[name]._replace(age=time.monotonic() - heard)
        if time.monotonic() >= self._host_due:
            self._host_due = time.monotonic() + HOST_PERIOD
            seen.host = self._host.read()
        return Situation(now, sample, self._magnet, seen.killed)

    def _take(self, readers: Readers) -> None:
        for topic, read in readers.items():
            inlet = self._subscriptions[topic]
            for message in self.door.messages(inlet):
                self.door.accepts(inlet, read, message)

    def _sample(self) -> Sample | None:
        if self._pose is None or self._joints is None or not self._inertial:
            return None
        rates, forces = zip(*self._inertial, strict=True)
        self._inertial.clear()
        position, attitude = self._pose
        return Sample(
            self._stamp,
            position,
            attitude,
            self._gyro.value.copy(),
            np.mean(forces, axis=0),
            np.mean(rates, axis=0),
            self._joints,
            self._commanded,
        )

    def _on_imu(self, data: bytes) -> None:
        stamp, rate, force = read_imu(data)
        at = stamp / SECOND
        self._streams[topics.IMU].add(at)
        self._gyro.add(at, rate)
        self._inertial.append((rate.copy(), force.copy()))
        self._stamp, self._arrival = at, time.monotonic()

    def _on_joints(self, data: bytes) -> None:
        stamp, position, _ = read_joints(data, self._names)
        self._streams[topics.JOINTS].add(stamp / SECOND)
        self._joints = position.copy()

    def _on_mocap(self, data: bytes) -> None:
        stamp, position, quaternion = read_pose(data)
        self._streams[topics.MOCAP].add(stamp / SECOND)
        self._pose = position.copy(), quaternion.copy()

    def _on_setpoint(self, data: bytes) -> None:
        self._commanded = Serialized(TwistStamped, data).vector("angular").copy()

    def _on_autopilot(self, message: Any) -> None:
        seen = self.observation
        state = AutopilotState.from_message(message)[1]
        seen.connected, seen.armed = state.connected, state.armed
        try:
            radio = RadioState.from_message(message)[1]
        except BadMessage:  # another bridge
            seen.killed = seen.radio = None
        else:
            seen.killed = radio.killed
            seen.radio = {"yes": True, "no": False}.get(radio.received)
        compared = ParameterComparison.from_message(message)
        if compared is not None:
            seen.parameters_read = compared.complete
            seen.differences = tuple(
                f"{one.name} is {'not answered' if one.found is None else f'{one.found:.7g}'}, "
                f"{one.required} required: {one.why}"
                for one in compared.differences
            )

    def _on_battery(self, message: Any) -> None:
        self.observation.battery = message.percentage

    def _on_temperature(self, message: Any) -> None:
        self.observation.temperatures[message.header.frame_id] = message.temperature

    def _on_magnet(self, message: Any) -> None:
        self._magnet = bool(message.data)

    def _on_preflight(self, message: Any) -> None:
        self.observation.preflight = tuple(read_checks(message))

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            name = unlabelled(self._node.get_namespace(), status.name)
            if name is None:
                continue
            values = {pair.key: pair.value for pair in status.values}
            self._heard[name] = time.monotonic()
            level = LEVELS.get(status.level, BAD)
            self.observation.nodes[name] = NodeReport(0.0, level, status.message, values)
            if (age := finite(values.get(POSE_AGE))) is not None:
                self.observation.pose_age = 1e-3 * age
