"""The operator's commands to a running flight: services and topics of mission and bridge."""

import math
import time
from collections.abc import Callable
from typing import Any, Self

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger

from uam_control.supervision import PreflightCheck
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.checklist import read_checks
from uam_msgs_py.messages.navigation import goal_message
from uam_msgs_py.messages.status import AutopilotState, ChecklistState, MissionStatus
from uam_msgs_py.node.door import Door
from uam_sim_bridge.ports import flights

DECODE: dict[topics.Topic, Callable[[DiagnosticArray], Any]] = {
    topics.MISSION_STATUS: MissionStatus.from_message,
    topics.AUTOPILOT_STATE: AutopilotState.from_message,
    topics.PREFLIGHT: read_checks,
    topics.CHECKLIST: lambda m: (ChecklistState.from_message(m), read_checks(m)),
}
PLANNERS = (topics.GOAL_POSE, topics.BASE_TRAJECTORY, topics.ARM_TRAJECTORY)
HAND_PLANNERS = (
    topics.END_EFFECTOR_GOAL,
    topics.END_EFFECTOR_TRAJECTORY,
    topics.END_EFFECTOR_TWIST,
)
LOOK = 0.05  # [s] between two looks for messages
AGAIN = 2.0  # [s] wall time without an answer after which a plan is sent again
PATIENCE = 12.0  # [s] wall time to find the flight on a busy machine, and as long for its answer


class NoFlight(RuntimeError):
    """No flight answers; the text is one line and says what to do."""

    @classmethod
    def seen_by(cls, node: Node, complaint: str) -> Self:
        """Return the error of a client `node` for a complaint, as "no service /mission/start".

        It names the flights that run on this computer: they may be in another domain.
        """
        found = "; ".join(
            f"--instance {one.instance}: domain {one.domain}, {one.namespace}" for one in flights()
        )
        return cls(
            f"{complaint} in ROS domain {node.context.get_domain_id()}: "
            "start a flight, or choose it by --instance, --namespace or ROS_DOMAIN_ID"
            + (f" (running: {found})" if found else "")
        )


class Operator:
    """Client of one flight; `node`: a node in its ROS domain and namespace, not spun by others."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._door = Door(node, tells=True)
        self._newest: dict[topics.Topic, Any] = {}  # decoded
        self._readers = {self._door.listen(topic): topic for topic in DECODE}

    @property
    def place(self) -> str:
        """Return ROS domain and namespace of the flight, for the user."""
        domain, namespace = self._node.context.get_domain_id(), self._node.get_namespace()
        return f"ROS domain {domain}, namespace {namespace}"

    def command(self, name: str) -> tuple[bool, str]:
        """Call a Trigger service of the mission; return whether it was accepted, and the answer.

        name: start, or one of `mission_inputs.COMMANDS`. Raises NoFlight.
        """
        return self._call(f"mission/{name}")

    def kill(self) -> tuple[bool, str]:
        """Stop the motors at once, in the air too: both calls of /mission/kill. Raises NoFlight."""
        self._call("mission/kill")
        return self._call("mission/kill")

    def goto(
        self, x: float, y: float, z: float, yaw: float = math.nan, hand: bool = False
    ) -> tuple[bool, str]:
        """Send a goal pose: position [m, ENU], yaw [rad]; z = 0 and a yaw of NaN keep the present.

        hand: of the end effector; its z = 0 is a height. Returns whether it was accepted, and the
        mission's answer. Raises NoFlight.
        """
        return self.plan(goal_message((x, y, z), yaw), hand)

    def plan(self, message: Any, hand: bool = False) -> tuple[bool, str]:
        """Send a goal or trajectory on the mission's topic of its type; see `goto`."""
        planners = HAND_PLANNERS if hand else PLANNERS
        topic = next((one for one in planners if isinstance(message, one.type)), None)
        if topic is None:
            kinds = ", ".join(one.type.__name__ for one in planners)
            raise TypeError(f"{type(message).__name__} is no plan: {kinds} expected")
        before, sent = self.mission().answers, -math.inf
        publisher = topic.outlet(self._node)

        def answered() -> bool:
            """Send again while the mission's end of the connection is perhaps not there yet."""
            nonlocal sent
            if publisher.get_subscription_count() and time.monotonic() - sent > AGAIN:
                publisher.publish(message)
                sent = time.monotonic()
            return self.mission().answers > before

        try:
            self._until(answered, "no answer of the mission")
        finally:
            self._node.destroy_publisher(publisher)
        _, _, answer = self.mission().answer.partition(": ")
        return not answer.startswith("refused"), answer

    def hand_pose(self) -> PoseStamped:
        """Return the estimate of the end effector from now on. Raises NoFlight."""
        topic = topics.END_EFFECTOR
        if topic not in self._readers.values():
            self._readers[self._door.listen(topic)] = topic
        self._newest.pop(topic, None)
        return self._latest(topic)

    def mission(self) -> MissionStatus:
        """Return the mission's newest status. Raises NoFlight."""
        return self._latest(topics.MISSION_STATUS)[1]

    def autopilot(self) -> AutopilotState:
        """Return the autopilot's newest state. Raises NoFlight."""
        return self._latest(topics.AUTOPILOT_STATE)[1]

    def preflight(self) -> list[PreflightCheck]:
        """Return the newest pre-arm report. Raises NoFlight."""
        return self._latest(topics.PREFLIGHT)

    def checklist(self) -> tuple[ChecklistState, list[PreflightCheck]]:
        """Return the newest state of the checklist, and its items. Raises NoFlight."""
        (_, state), items = self._latest(topics.CHECKLIST)
        return state, items

    def checklist_command(self, name: str) -> tuple[bool, str]:
        """Call a service of the checklist, confirm or repeat; returns as `command`."""
        return self._call(f"checklist/{name}")

    def look(self, seconds: float) -> None:
        """Receive messages for `seconds` of wall time."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._spin(min(left, LOOK))

    def _spin(self, seconds: float) -> None:
        """Serve clients for at most `seconds`, then take the received messages."""
        self._executor.spin_once(timeout_sec=seconds)
        for inlet, topic in self._readers.items():
            for found in self._door.decoded(inlet, DECODE.get(topic, lambda message: message)):
                self._newest[topic] = found

    def _latest(self, topic: topics.Topic) -> Any:
        """Return the newest message of a topic; the node may have sent it before this call."""
        self._until(
            lambda: topic in self._newest,
            f"no message on {self._node.resolve_topic_name(topic.name)}",
        )
        return self._newest[topic]

    def _call(self, service: str) -> tuple[bool, str]:
        client = self._node.create_client(Trigger, service)
        name = self._node.resolve_service_name(service)
        try:
            self._until(client.service_is_ready, f"no service {name}")
            future = client.call_async(Trigger.Request())
            self._until(future.done, f"no answer of {name}")
            answer = future.result()
            return answer.success, answer.message
        finally:
            self._node.destroy_client(client)

    def _until(self, done: Any, complaint: str) -> None:
        end = time.monotonic() + PATIENCE
        while not done():
            if time.monotonic() > end:
                raise NoFlight.seen_by(self._node, complaint)
            self._spin(LOOK)
