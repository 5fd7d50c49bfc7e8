"""Ways into the mission node for planners: goal pose and trajectories, each with an answer.

| topic | type | does |
|---|---|---|
| `goal_pose` | geometry_msgs/PoseStamped | fly to a pose and hold there |
| `base_trajectory` | trajectory_msgs/MultiDOFJointTrajectory | fly a trajectory of the base |
| `arm_trajectory` | trajectory_msgs/JointTrajectory | move the arm along a trajectory |
| `end_effector/goal_pose` | geometry_msgs/PoseStamped | bring the end effector to a pose |
| `end_effector/trajectory` | trajectory_msgs/MultiDOFJointTrajectory | and along a trajectory |
| `end_effector/twist` | geometry_msgs/TwistStamped | move it until the messages stop |

The answer is a line in the log (at most one accepted and one refused per second and topic), an
entry in /diagnostics, and `answers` (how many goals and trajectories were answered) with `answer`
(the newest) in the mission status.
"""

from collections.abc import Callable, Sequence
from functools import partial

from uam_control.mission import Mission
from uam_control.mission.motion.flyer import Flyer
from uam_control.mission.plans import Goal
from uam_control.nodes.hand_messages import read_hand_goal, read_hand_trajectory, read_hand_twist
from uam_control.nodes.planner_messages import read_arm_trajectory, read_base_trajectory, read_goal
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.node.base_node import UamNode
from uam_msgs_py.node.namespace import frame

LOG_PERIOD = 1_000_000_000  # [ns] from one line of a topic's answers to the next


class PlannerInputs:
    """Subscriptions for planners; `answers`, `answer`: for the mission status."""

    def __init__(
        self,
        node: UamNode,
        mission: Mission,
        joints: Sequence[str],
        flyer: Flyer | None,
        publish: Callable[[], None],
    ):
        """joints: their names; flyer: of the end effector, None without one; publish: publishes
        the mission status."""
        self._node, self._mission, self._publish = node, mission, publish
        self.answers, self.answer = 0, ""
        self._take(topics.GOAL_POSE, read_goal)
        self._take(topics.BASE_TRAJECTORY, read_base_trajectory)
        self._take(topics.ARM_TRAJECTORY, lambda data: read_arm_trajectory(data, joints))
        tool = frame(node, topics.TOOL)
        self._take(topics.END_EFFECTOR_GOAL, partial(read_hand_goal, flyer=flyer))
        self._take(topics.END_EFFECTOR_TRAJECTORY, partial(read_hand_trajectory, flyer=flyer))
        self._take(topics.END_EFFECTOR_TWIST, partial(read_hand_twist, flyer=flyer, tool=tool))

    def _take(self, topic: topics.Topic, read: Callable[[bytes], Goal]) -> None:
        logged: dict[bool, int] = {}  # accepted → stamp of the newest line

        def handle(data: bytes) -> None:
            try:
                accepted, text = self._mission.plan(read(data))
            except BadMessage as error:
                accepted, text = False, f"refused: {error}"
            self.answers, self.answer = self.answers + 1, f"{topic.name}: {text}"
            self._publish()
            now = self._node.stamp
            if accepted in logged and 0 <= now - logged[accepted] < LOG_PERIOD:
                return  # a stream of goals
            logged[accepted] = now
            log = self._node.get_logger()
            # two calls: rclpy requires one severity per line of code
            if accepted:
                log.info(self.answer)
            else:
                log.warning(self.answer)

        self._node.listen(topic, handle, required=False, qos=topic.qos, raw=True)
