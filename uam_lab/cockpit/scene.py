"""Node: /tf, URDF, markers and tracking errors, for RViz and Foxglove.

    world ─┬─ base_link (estimate) ─┬─ shoulder
           │                        └─ link_1 ─ link_2 ─ magnet ─ end_effector
           ├─ reference (in flight)
           └─ payload (in simulation)

No other node waits for this node. It polls the newest messages 100 times per second (best-effort
QoS) and publishes `frame_rate` transforms per second of message time. Before the first tick of a
simulated flight every publisher counts its subscribers. This node must not be counted in place of
another, so it subscribes to the topics of the control loop only after the mission's first status.
"""

import math
import time
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Float64, String

from uam_control.arm.chain import Chain
from uam_control.arm.hand import hand_in_world
from uam_control.coordinates import ALPHA, ANGLES, ARM, ATTITUDE, CHI, CHI_DDOT, CHI_DOT, POSITION
from uam_control.maths.rotations import quaternion_from_euler, wrap_angle
from uam_control.nodes.described import described_scenario, described_vehicle
from uam_control.settings.parameter_set import ParameterSet, number
from uam_control.stamps import SECOND
from uam_control.vehicle import TWO_FINGER, chain_of
from uam_lab.cockpit.scene_markers import PAYLOAD, FlownPath, Markers, ReferencePath
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import (
    PositionCommand,
    Reference,
    read_position_command,
    read_reference,
    read_state,
)
from uam_msgs_py.messages.convert import JointStateWriter, read_pose
from uam_msgs_py.messages.status import ERROR, OK, MissionStatus
from uam_msgs_py.messages.tf_message import Transform, transforms_message
from uam_msgs_py.messages.topics import BODY, WORLD
from uam_msgs_py.node.base_node import UamNode, run
from uam_msgs_py.node.namespace import frame
from uam_msgs_py.node.node_parameters import NodeParameters
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.frames import Frame, box, end_effector, frames, hanging
from uam_sim_bridge.plant.gripper import FINGERS
from uam_sim_bridge.plant.urdf import urdf
from uam_sim_bridge.plant.vehicle import SWING

NAME = "scene"
REFERENCE = "reference"  # frame of the desired pose
STORED = 8  # ticks, until the messages of the same tick have arrived


@dataclass(frozen=True)
class SceneParameters(ParameterSet):
    """Rates of the published transforms and markers."""

    frame_rate: float = number(25.0, "transforms per second of the messages' time", "Hz", 1.0, 60.0)
    marker_rate: float = number(2.0, "markers, likewise, unless they change", "Hz", 0.1, 25.0)


HAND_NAMES = tuple(f"end_effector_{axis}" for axis in "xyz")  # of the error's entries
STEP = 1e-4  # [s] of the numerical derivative of the hand's place


class SceneNode(UamNode):
    """Publishes /tf, /tf_static, /robot_description, /uam/markers and /uam/tracking/error."""

    wake_up = 0.01

    def __init__(self) -> None:
        super().__init__(NAME)
        options = NodeParameters(self, SceneParameters, read_only=True).current
        self._frame_period = round(SECOND / options.frame_rate)
        self._marker_period = round(SECOND / options.marker_rate)
        described = described_vehicle(self)
        self._joint_names = described.joint_names
        self._scenario = described_scenario(self, described)
        vehicle = Vehicle.of(described).changed(self._scenario.surroundings)
        model = vehicle.compile(0.0)
        hung = frames(model)
        self._fixed = [frame for frame in hung if not frame.joint]
        self._moving = [frame for frame in hung if frame.joint]
        self._has_fingers = described.gripper.kind == TWO_FINGER
        self._frame = partial(frame, self)
        face = box(model, "magnet_face") if described.has_magnet else None
        boxes = face, box(model, "payload")
        self._maker = Markers(self._scenario, *boxes, self._frame(""))

        self._state: tuple[int, np.ndarray] | None = None
        self._references: dict[int, Reference] = {}
        self._states: dict[int, np.ndarray] = {}
        self._command: tuple[int, PositionCommand] | None = None
        self._payload: tuple[int, np.ndarray, np.ndarray] | None = None
        self._opening = described.gripper.opening[1]  # [m] of fingers, measured
        self._payload_is_there = False  # only a simulator publishes its pose
        self._status: tuple[int, MissionStatus] | None = None
        self._path: ReferencePath | None = None
        self._in_flight = False  # whether _path begins at the take-off position
        self._flown = FlownPath()
        self._due = self._markers_due = 0  # [ns]
        self._shown: tuple = ()  # content of the last markers
        self._late: list = []  # subscriptions made after the mission's first status

        self._tf = self.publisher(topics.TF)
        self._markers = self.publisher(topics.MARKERS)
        self._error = self.publisher(topics.TRACKING_ERROR)
        self._chain = chain_of(described)
        hand = HAND_NAMES if self._chain.has_hand else ()
        self._error_writer = JointStateWriter((*described.coordinates, *hand), WORLD)
        self._describe(urdf(vehicle), end_effector(model, described.end_effector))
        self.listen(topics.MISSION_STATUS, self._on_status)
        # other topics are polled when a status arrives or after `wake_up`
        self.triggers = (topics.MISSION_STATUS.name,)

    def _describe(self, robot: str, hand: list[Frame]) -> None:
        """Publish the constant data: URDF and fixed transforms."""
        self.publisher(topics.ROBOT_DESCRIPTION).publish(String(data=robot))
        still = [
            Transform(0, self._frame(f.parent), self._frame(f.name), f.position, f.quaternion)
            for f in (*self._fixed, *hand)
        ]
        self.publisher(topics.TF_STATIC).publish(transforms_message(still))

    def _on_status(self, message: DiagnosticArray) -> None:
        self._status = MissionStatus.from_message(message)
        if not self._late:
            self._late = [
                self.listen(topic, handle, required=topic is topics.STATE, qos=topics.NEWEST)
                for topic, handle in (
                    (topics.REFERENCE, self._on_reference),
                    (topics.TRUTH_PAYLOAD, self._on_payload),
                    (topics.POSITION_COMMAND, self._on_command),
                    (topics.STATE, self._on_state),
                    (topics.GRIPPER_STATE, self._on_gripper),
                )
                if topic is not topics.GRIPPER_STATE or self._has_fingers
            ]

    def _on_state(self, data: bytes) -> None:
        self._state = read_state(data)
        _store(self._states, *self._state)

    def _on_reference(self, data: bytes) -> None:
        _store(self._references, *read_reference(data))

    def _on_command(self, data: bytes) -> None:
        self._command = read_position_command(data)

    def _on_payload(self, data: bytes) -> None:
        self._payload = read_pose(data)

    def _on_gripper(self, message: Float64) -> None:
        if math.isfinite(message.data):
            self._opening = message.data

    def settle(self) -> None:
        """Publish transforms, errors and markers of the newest state when they are due."""
        for subscription in self._late:
            self.take_waiting(subscription)
        if self._state is None or self._state[0] < self._due:
            return
        begun = time.perf_counter()
        stamp, state = self._state
        reference = self._references.get(stamp)
        self._due = max(self._due, stamp - self._frame_period) + self._frame_period
        self._compare()
        desired = reference.values[0] if reference is not None and reference.flying else None
        self._tf.publish(transforms_message(self._transforms(stamp, state[0], desired)))
        self._follow(stamp, state[0], desired)
        self._show(stamp)
        self._state = None
        self.done_tick(stamp, begun)

    def _compare(self) -> None:
        """Publish the tracking errors of the newest tick of which all messages have arrived.

        The reference of the attitude is that of the position law.
        """
        stamp, command = self._command or (-1, None)
        state, reference = self._states.get(stamp), self._references.get(stamp)
        if state is None or reference is None:
            return
        self._command = None  # each tick is published once
        desired = reference.values[:CHI_DDOT].copy()
        desired[:, ATTITUDE] = command.attitude[:CHI_DDOT]
        error = state[:CHI_DDOT] - desired
        error[CHI, ANGLES] = wrap_angle(error[CHI, ANGLES])
        if not reference.flying:
            error[:, :ALPHA] = 0.0
        hand = _hand_error(self._chain, state, desired) if reference.flying else np.zeros((2, 3))
        writer = self._error_writer
        kept = len(writer.position)  # with or without the hand
        writer.position[:], writer.velocity[:] = np.hstack([error, hand])[:, :kept]
        self._error.publish(writer.stamped(stamp))

    def _transforms(
        self, stamp: int, chi: np.ndarray, desired: np.ndarray | None
    ) -> list[Transform]:
        """Return the moving transforms at `stamp` [ns] for chi and the desired chi_d (6 + n,)."""
        turned = quaternion_from_euler(chi[ATTITUDE])
        angles = dict(zip(self._joint_names, chi[ARM], strict=True))
        angles[SWING] = hanging(chi[ATTITUDE][1], chi[ARM])
        angles |= dict.fromkeys(FINGERS, 0.5 * self._opening)
        own = self._frame
        found = [Transform(stamp, WORLD, own(BODY), chi[POSITION], turned)]
        found += [
            Transform(stamp, own(f.parent), own(f.name), *f.moved(angles[f.joint]))
            for f in self._moving
        ]
        if desired is not None:
            pose = desired[POSITION], quaternion_from_euler(desired[ATTITUDE])
            found.append(Transform(stamp, WORLD, own(REFERENCE), *pose))
        if self._payload is not None:
            at, position, quaternion = self._payload
            found.append(Transform(at, WORLD, own(PAYLOAD), position, quaternion))
            self._payload, self._payload_is_there = None, True  # publish each stamp only once
        return found

    def _follow(self, stamp: int, chi: np.ndarray, desired: np.ndarray | None) -> None:
        """Update the paths; the reference path begins at the take-off position."""
        self._flown.add(stamp, chi[POSITION])
        flying = desired is not None
        if self._path is None or flying and not self._in_flight:
            self._path = ReferencePath(self._scenario, desired if flying else chi)
            self._in_flight = flying

    def _show(self, stamp: int) -> None:
        """Publish the markers when they change, and with `marker_rate`."""
        at, status = self._status
        now = (status.summary, status.magnet, self._payload_is_there)
        if now == self._shown and stamp < self._markers_due:
            return
        self._shown, self._markers_due = now, stamp + self._marker_period
        mission_time = status.time + (stamp - at) / SECOND
        ahead = self._path.ahead(0.0 if status.time < 0.0 else mission_time)
        if status.done or status.abort_reason:
            ahead = ahead[:0]
        self._markers.publish(self._maker.message(stamp, status, ahead, self._flown.points, now[2]))

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Return level, phase of the mission, and whether the payload is shown."""
        if self._status is None:
            return OK, "waiting for the mission", {}
        status = self._status[1]
        level = ERROR if status.abort_reason else OK
        return level, f"showing {status.summary}", {"payload": self._payload_is_there}


def _hand_error(chain: Chain, state: np.ndarray, desired: np.ndarray) -> np.ndarray:
    """Return the error of the end effector (2, 3) [m, m/s], world; state, desired: (2+, 6 + n)."""

    def hand(chi: np.ndarray) -> np.ndarray:
        return np.array(hand_in_world(chain, chi)[0])

    def velocity(of: np.ndarray) -> np.ndarray:
        ahead, behind = (hand(of[CHI] + step * of[CHI_DOT]) for step in (STEP, -STEP))
        return (ahead - behind) / (2.0 * STEP)

    return np.array([one(state) - one(desired) for one in (lambda of: hand(of[CHI]), velocity)])


def _store(ticks: dict[int, Any], stamp: int, value: Any) -> None:
    """Store a value by its stamp, and at most STORED of them."""
    ticks[stamp] = value
    if len(ticks) > STORED:
        del ticks[min(ticks)]


def main() -> int:
    """Run the node; return its exit status."""
    return run(SceneNode, NAME)
