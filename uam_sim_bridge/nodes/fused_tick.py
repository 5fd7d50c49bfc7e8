"""The tick of all control nodes in one process: `ControlTick` on decoded inputs.

The nodes have the stages, and publish what their stages have computed. Each sensor is read once.
What other processes wait for is published from the signals after the setpoint has left, the topics
between the stages at the end of the tick. The nodes' subscriptions to each other are in the graph,
and another publisher is refused and named; their messages are not used.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from rclpy.subscription import Subscription

from uam_control.coordinates import ALPHA
from uam_control.nodes.whole_body_controller import compile_whole
from uam_control.stages.control_tick import ControlTick
from uam_control.stages.step import Stage
from uam_control.stamps import SECOND
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import read_efforts, read_grip, read_imu, read_joints, read_pose
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.messages.serialized import stays_stamped
from uam_msgs_py.node import wiring
from uam_msgs_py.node.base_node import UamNode
from uam_msgs_py.node.joins import BACKLOG
from uam_msgs_py.node.rightful import full_name
from uam_msgs_py.node.tick_times import DECODE, STAGE

Run = Callable[[ControlTick], bool]
INNER = [wire for wire in wiring.WIRES if wire.publisher in wiring.FUSED]
AS_MESSAGES = topics.AUTOPILOT_BATTERY, topics.MAGNET  # no signals of the tick
SENSORS = topics.JOINTS, topics.IMU, topics.PAYLOAD  # and the poses, see `_read_wires`


def is_whole(nodes: Mapping[str, UamNode]) -> bool:
    """Return whether the nodes are all of FUSED, and read each other's topics and one sensor each.

    Parameter `publishers` and remappings may name others.
    """
    if len(nodes) < len(wiring.FUSED):
        return False
    for wire in INNER:
        publisher = nodes[wire.publisher]
        own = full_name(publisher.get_namespace(), publisher.get_name())
        sent = publisher.resolve_topic_name(wire.topic.name)
        if _sources(nodes, wire) - {(own, sent), None}:
            return False
    read = [_sources(nodes, wire) for wire in _read_wires(nodes[wiring.ESTIMATOR].poses.topic)]
    return all(len(one) == 1 and None not in one for one in read)


def _read_wires(poses: topics.Topic) -> list[wiring.Wire]:
    """Return the wires of the sensors; poses: topic of the estimator's poses."""
    wires = wiring.WIRES if poses == topics.MOCAP else wiring.with_odometry(wiring.WIRES)
    return [wire for wire in wires if wire.topic in (poses, *SENSORS)]


def _sources(nodes: Mapping[str, UamNode], wire: wiring.Wire) -> set[tuple[str, str] | None]:
    """Return the names of publisher and topic that the nodes read a wire's topic from.

    None: a node does not read it.
    """
    name = wire.topic.name
    readers = [nodes[one] for one in wire.subscribers if one in nodes]
    return {
        (node.rightful.of(name).name, node.inlets[name].topic_name) if name in node.inlets else None
        for node in readers
    }


class Thinned:
    """Sends of a topic the first message of each `period` [ns] of stamps, 0: every one."""

    def __init__(self, send: Callable[[bytes], None]) -> None:
        self._send, self.period, self._sent = send, 0, -1

    def __call__(self, message: bytes) -> None:
        """Send a message with a stamp, if it is due."""
        if self.period:
            last, self._sent = self._sent, stamp_of(message)
            if self._sent // self.period == last // self.period:
                return
        self._send(message)


class FusedTick:
    """The tick of the nodes wiring.FUSED. `dropped`: number of ticks without an answer."""

    def __init__(self, process: UamNode, nodes: Mapping[str, UamNode]) -> None:
        """process: its node, which counts the ticks; nodes: by their names, see `is_whole`."""
        self._process, self._nodes = process, nodes
        self._estimator, self._mission, *self._laws, self._bridge = (
            nodes[name] for name in wiring.FUSED
        )
        laws = [law.stage for law in self._laws]
        self._tick = ControlTick(
            *(self._estimator.stage, self._mission.stage, laws),
            *(nodes[wiring.ARM].hand, self._bridge.stage),
        )
        self._joints = list(self._laws[0].vehicle.joint_names)
        self._samples: list[tuple[int, np.ndarray, np.ndarray]] = []  # of the IMU
        self._begun = 0.0  # time.perf_counter() at the begin of the mission's tick
        self.dropped, self._behind = 0, False
        self._thinned = [self._thin(wire) for wire in INNER if _is_thinned(wire)]
        self._listen()
        self._arrange()

    def thin(self, rate: float) -> None:
        """Send topics that nobody else needs at most at this rate [Hz of stamps]; 0: all."""
        for one in self._thinned:
            one.period = round(SECOND / rate) if rate else 0

    def _thin(self, wire: wiring.Wire) -> Thinned:
        publisher = self._nodes[wire.publisher].outlets[wire.topic.name]
        publisher.publish = made = Thinned(publisher.publish)
        return made

    def _listen(self) -> None:
        """Read each sensor once, and no topic whose content is a signal."""
        signals = [wire for wire in INNER if wire.topic not in AS_MESSAGES]
        poses = self._estimator.poses
        for wire in (*signals, *_read_wires(poses.topic)):
            for name in self._nodes.keys() & set(wire.subscribers):
                self._nodes[name].handle_by(wire.topic, lambda message: None)
        readers = {
            poses.topic: (self._estimator, self._on_pose),
            topics.JOINTS: (self._estimator, self._on_joints),
            topics.PAYLOAD: (self._mission, lambda data: self._tick.tick(payload=read_pose(data))),
            topics.IMU: (self._estimator, lambda data: self._samples.append(read_imu(data))),
        }
        for topic, (node, handle) in readers.items():
            node.handle_by(topic, handle)
        *self._before_imu, (_, self._imu) = (
            (node, node.inlets[topic.name]) for topic, (node, _) in readers.items()
        )

    def _on_pose(self, message: Any) -> None:
        pose = self._estimator.poses.read(message)
        self._estimator.note_pose(pose[0])
        self._tick.tick(mocap=pose)

    def _on_joints(self, data: bytes) -> None:
        """Take the joints. Without usable efforts the message is refused, its angles count."""
        readings, effort = read_joints(data, self._joints), np.full(len(self._joints), np.nan)
        grip = read_grip(data)
        try:
            _, effort = read_efforts(data, self._joints)
        finally:
            known = None if grip is None else (readings[0], grip)
            self._tick.tick(joints=(*readings, effort), grip=known)

    def often(self, subscription: Subscription) -> bool:
        """Return whether a subscription is read at each wake-up: the IMU, the clock of its stamps.

        Others are read with the next sample of the IMU, or between two ticks.
        """
        clock = self._bridge.inlets.get(topics.CLOCK.name)
        return subscription in (self._imu, clock)

    def _arrange(self) -> None:
        """Put the nodes' parts between the stages of the tick."""
        tick = self._tick
        laws = ["position law", "attitude law", "arm law"]
        if tick.whole is not None:
            laws = ["whole body"] * len(laws)
            compile_whole(self._laws)
        counted = ("estimator", *laws, "bridge")
        nodes = (self._estimator, *self._laws, self._bridge)
        stages = {stage.name: stage.run for stage in tick.stages}
        stages["estimator"] = self._estimating(stages["estimator"])
        for name, node in zip(counted, nodes, strict=True):
            stages[name] = _counted(node, stages[name])
        tick.stages[:] = [Stage(name, run) for name, run in stages.items()]
        tick.insert("mission", "newest ticks", lambda tick: not self._behind)
        tick.insert("mission", "wall clock", self._note_time)
        tick.insert(laws[0], "status", self._tell)
        tick.insert("bridge", "link", self._begin_link)
        answer = self._process.times.measured(self._answer)
        tick.insert("next reference", "answers", lambda tick: answer() is None)

    def _estimating(self, run: Run) -> Run:
        return lambda tick: bool(self._estimator.estimated(lambda: run(tick)))

    def _note_time(self, tick: ControlTick) -> bool:
        self._begun = time.perf_counter()
        self._mission.note_time(tick.signals.stamp)
        return True

    def _tell(self, tick: ControlTick) -> bool:
        s = tick.signals
        if not s.flying:  # as in the message of the reference
            s.reference[:, :ALPHA] = 0.0
        self._mission.times.lap(STAGE)
        self._mission.tell(s.stamp, s.state)
        self._bridge.note_mission(s.stamp, s.time, s.phase)
        return True

    def _begin_link(self, tick: ControlTick) -> bool:
        tick.signals.late = self._bridge.begin_tick(tick.signals.stamp)
        return True

    def _answer(self) -> None:
        """Publish what other processes wait for."""
        s = self._tick.signals
        self._mission.answer()
        for law in self._laws:
            law.answer()
        self._bridge.answer(s.stamp, s.setpoint)

    def settle(self) -> None:
        """Run the ticks of the IMU samples that have arrived.

        The estimator needs all samples. Of more than BACKLOG only the newest has a whole tick:
        otherwise the delay would remain.
        """
        if not self._samples:
            return
        for node, subscription in self._before_imu:
            node.take_waiting(subscription)
        samples, self._samples = self._samples, []
        last = len(samples) - 1
        for number, sample in enumerate(samples):
            self._behind = last >= BACKLOG and number < last
            self.dropped += self._behind
            self._run(sample)

    def _run(self, sample: tuple[int, np.ndarray, np.ndarray]) -> None:
        begun = time.perf_counter()
        self._process.times.lap(DECODE)
        self._estimator.begin_anew_before(sample[0])
        self._tick.estimator = self._estimator.stage
        if not self._tick.tick(imu=sample):
            return
        s = self._tick.signals
        self._mission.times.lap(STAGE)
        self._mission.done_tick(s.stamp, self._begun)
        self._send(s.flying)
        self._process.done_tick(s.stamp, begun)

    def _send(self, flying: bool) -> None:
        """Publish the topics between the stages."""
        s, stage = self._tick.signals, self._estimator.stage
        desired = s.attitude_reference[0].copy() if flying else None
        self._mission.errors.note_desired(s.stamp, desired)
        self._estimator.send(s.stamp, s.state, self._tick.biases if stage.bias_due else None)
        self._mission.send()
        for law, tau in zip(self._laws, (s.tau_p, s.tau_q, s.tau_alpha), strict=True):
            law.send(s.stamp, tau, s.reference, flying)
        self._bridge.send(s.stamp)


def _is_thinned(wire: wiring.Wire) -> bool:
    """Return whether only nodes of the process need a topic, and its messages have stamps."""
    return set(wire.subscribers) <= set(wiring.FUSED) and stays_stamped(wire.topic.type)


def _counted(node: UamNode, run: Run) -> Run:
    """Return `run` as a tick of the node."""

    def counted(tick: ControlTick) -> bool:
        begun = time.perf_counter()
        if not run(tick):
            return False
        node.times.lap(STAGE)
        node.done_tick(tick.signals.stamp, begun)
        return True

    return counted
