"""Node: motion capture + IMU + joints → chi, chi_dot, chi_ddot, once per IMU sample."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from uam_control.coordinates import CHI
from uam_control.estimation import catalogue
from uam_control.laws.catalogue import DEFAULT
from uam_control.nodes.described import described_hand, described_vehicle
from uam_control.nodes.pose_source import PoseSource
from uam_control.profiles.profile import default_profile
from uam_control.settings.parameter_set import ParameterSet, number
from uam_control.stages.estimator_stage import EstimatorStage, estimator_stage
from uam_control.stamps import NEW_TIME, SECOND
from uam_control.vehicle import derived_parameters
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import ImuWriter, TrajectoryWriter, read_imu, read_joints
from uam_msgs_py.messages.navigation import hand_message, odometry_message
from uam_msgs_py.messages.status import ERROR, OK, WARN
from uam_msgs_py.node.base_node import UamNode, run
from uam_msgs_py.node.joins import Backlog
from uam_msgs_py.node.namespace import frame
from uam_msgs_py.node.node_parameters import NodeParameters, given
from uam_msgs_py.node.tick_times import DECODE, STAGE

NAME = "state_estimator"
POSES = 100  # of which the interval is measured
T = TypeVar("T")
DIVERGED = "the estimate has diverged: no state for 1 s; look at the rates of IMU, poses and joints"


@dataclass(frozen=True)
class OdometryParameters(ParameterSet):
    """Rate of nav_msgs/Odometry; fixed once the node runs."""

    odometry_rate: float = number(
        50.0, "odometry and poses of the end effector per second of stamps", "Hz", 1.0, 1000.0
    )


class StateEstimatorNode(UamNode):
    """Publishes /uam/state with the stamp of its IMU sample, without its jitter.

    The IMU sample starts a tick. The sensor hub (here the simulator) publishes it last. All other
    samples of the tick have then arrived, and a repeated flight uses the same samples.
    """

    def __init__(self):
        super().__init__(NAME)
        vehicle = described_vehicle(self)
        self._names = list(vehicle.joint_names)
        choice = {name: value for name, value in given(self).items() if name == "estimator"}
        section = catalogue.own_values(default_profile(DEFAULT, vehicle).section(NAME) | choice)
        derived = derived_parameters(vehicle)[NAME]
        kind = catalogue.chosen(section).kind
        self.parameter_set = NodeParameters(self, kind, defaults=section, derived=derived)
        self._period = vehicle.control_period
        self.stage = self._new_stage()
        self.parameter_set.apply = self.stage.estimator.set_parameters
        self._warm_up()
        self._state = self.publisher(topics.STATE)
        self._writer = TrajectoryWriter(vehicle.coordinates)
        self._odometry = self.publisher(topics.ODOMETRY)
        self._hand = self.publisher(topics.END_EFFECTOR)
        self._flyer = described_hand(vehicle)
        self._bias = self.publisher(topics.IMU_BIAS)
        self._body = frame(self, topics.BODY)
        self._bias_writer = ImuWriter(self._body)
        rate = NodeParameters(self, OdometryParameters, read_only=True).current.odometry_rate
        self._odometry_period = round(SECOND / rate)  # [ns]
        self._odometry_at = 0  # [ns] stamp of the last odometry
        self.poses = PoseSource(self)
        if self.poses.odometry:
            self.stage.estimator.use_odometry()
        self._mocap = self.listen(self.poses.topic, self._on_mocap)
        self._joints = self.listen(
            topics.JOINTS, lambda data: self.stage.joints(*read_joints(data, self._names))
        )
        self.listen(topics.IMU, self._on_imu)
        self.triggers = (topics.IMU.name,)
        self._diverged_before = 0  # times that the estimate had diverged at the last look
        self._refused_before = 0  # number of refused poses at the last report
        self._exposed: deque[int] = deque(maxlen=POSES)  # stamps [ns] since the last report
        self._updates = Backlog()

    def _new_stage(self) -> EstimatorStage:
        return estimator_stage(self.parameter_set.current, len(self._names), self._period)

    def _on_mocap(self, message: Any) -> None:
        stamp, position, quaternion = self.poses.read(message)
        self.note_pose(stamp)
        self.stage.mocap(stamp, position, quaternion)

    def note_pose(self, stamp: int) -> None:
        """Note the stamp [ns] of a pose that has arrived."""
        self._exposed.append(stamp)

    def _on_imu(self, data: bytes) -> None:
        begun = time.perf_counter()
        stamp, gyro, force = read_imu(data)
        self.begin_anew_before(stamp)
        self.take_waiting(self._mocap)
        self.take_waiting(self._joints)
        self.times.lap(DECODE)
        state = self.estimated(lambda: self.stage.imu(stamp, gyro, force))
        self.times.lap(STAGE)
        if state is None:
            return
        # one state per sample: the filters need every sample
        biases = self.stage.estimator.imu_bias if self.stage.bias_due else None
        self._updates.put((self.stage.stamp, state.copy(), biases, begun))

    def estimated(self, take: Callable[[], T]) -> T | None:
        """Return take(), which gives the stage an IMU sample; None if it is an older one."""
        try:
            found = take()
        except ValueError as error:
            self.warn(f"{error}; ignored", "imu")
            return None
        if self.stage.diverged > self._diverged_before:
            self._diverged_before = self.stage.diverged
            self.get_logger().error(f"{DIVERGED}; it begins anew")
        return found

    def begin_anew_before(self, stamp: int) -> None:
        """Forget all samples if the stamp [ns] of the next one is that of a new simulation."""
        if stamp >= self.stage.stamp - NEW_TIME:
            return
        self.get_logger().warning(
            f"stamps went back from {self.stage.stamp / SECOND:.3f} s to "
            f"{stamp / SECOND:.3f} s: the estimate begins anew"
        )
        self.stage = self._new_stage()
        self.parameter_set.apply = self.stage.estimator.set_parameters
        self._diverged_before = 0

    def settle(self) -> None:
        for stamp, state, biases, begun in self._updates.take():
            self.send(stamp, state, biases)
            self.done_tick(stamp, begun)

    def send(self, stamp: int, state: np.ndarray, biases: np.ndarray | None) -> None:
        """Publish the state (3, 6 + n) of a tick, and what is due besides.

        biases (2, 3): of gyroscope and accelerometer, None if they are not due.
        """
        self._state.publish(self._writer.fill(stamp, state))  # the controllers wait for it
        if biases is not None:
            self._bias.publish(self._bias_writer.fill(stamp, *biases))
        if 0 <= stamp - self._odometry_at < self._odometry_period:
            return
        self._odometry_at = stamp - stamp % self._odometry_period
        if self._odometry.get_subscription_count():
            self._odometry.publish(odometry_message(stamp, state, self._body))
        if self._flyer is not None and self._hand.get_subscription_count():
            self._hand.publish(hand_message(stamp, self._flyer.chain, state[CHI]))

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        refused = self.stage.estimator.refused_poses
        # a new estimate counts from zero
        fresh, self._refused_before = max(0, refused - self._refused_before), refused
        gaps = np.diff(sorted(set(self._exposed)))
        self._exposed.clear()
        ticks, age = self.stage.ticks, self.stage.pose_age
        values: dict[str, object] = {
            "poses refused": refused,
            "estimates begun anew": self.stage.diverged,
            "IMU samples repeated": ticks.repeated,
            "IMU samples missing": ticks.missing,
            "pose age at arrival, mean [ms]": ""
            if age.average is None
            else f"{1e-6 * age.average:.1f}",
            "pose age at arrival, max [ms]": f"{1e-6 * age.largest:.1f}",
        }
        age.restart()
        if self.stage.held_back:
            return ERROR, DIVERGED, values
        jumped = self.poses.news()
        if fresh:
            return WARN, f"{fresh} new poses refused: too far from the estimate", values
        if jumped:
            return WARN, jumped, values
        if gaps.size and (lines := self.parameter_set.current.capped(np.median(gaps) / SECOND)):
            return WARN, "; ".join(lines), values
        return OK, "running", values

    def _warm_up(self) -> None:
        """Compile the filters with a spare estimator."""
        spare = self._new_stage()
        rest, level = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        joints = np.zeros(len(self._names))
        for stamp in range(0, 12_000_000, 4_000_000):
            spare.mocap(stamp, rest, level)
            spare.joints(stamp, joints, joints)
            spare.imu(stamp, rest, np.array([0.0, 0.0, spare.estimator.parameters.gravity]))


main = partial(run, StateEstimatorNode, NAME)  # returns the exit status
