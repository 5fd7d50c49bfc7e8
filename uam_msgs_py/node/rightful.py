"""Names of the nodes that may publish the topics of the control loop.

| topic of | rightful node |
|---|---|
| a node of this stack | the node of that name in the reader's namespace, no other |
| `mujoco_sim`: sensors, clock | that node; without it, as on a vehicle, the first that sends |

The parameter `publishers` of every reader names others:

    publishers: "mission=my_planner, imu/data=imu_driver"    by node or by topic
    publishers: "arm_controller=any"                          the first that sends stays
    publishers: "any"                                         the same for every topic
"""

from dataclasses import dataclass

from rclpy.node import Node

from uam_control.settings.parameter_set import ParameterError, Text
from uam_msgs_py.messages import topics
from uam_msgs_py.node import wiring
from uam_msgs_py.node.namespace import NAME
from uam_msgs_py.node.node_parameters import declared_text

PARAMETER, ANY = "publishers", "any"
PUBLISHERS = {wire.topic.name: wire.publisher for wire in wiring.WIRES} | {
    topics.ODOMETRY_IN.name: wiring.PLANT,
    topics.PREFLIGHT.name: wiring.MISSION,
    topics.CHECKLIST.name: wiring.CHECKLIST,
    topics.RECORDED_UNTIL.name: wiring.RECORDER,
    topics.RESTARTS.name: wiring.FLIGHT,
}
ALLOWED = "NODE=NAME or TOPIC=NAME with commas between; NAME 'any': the first that sends"


@dataclass(frozen=True)
class Rightful:
    """name: of the node, with its namespace; only: others are refused also while it is absent."""

    name: str
    only: bool


class RightfulNodes:
    """The rightful node of each topic, for a reader in `namespace`."""

    def __init__(self, namespace: str = "/", given: str = "") -> None:
        """given: the parameter `publishers`. Raises ParameterError."""
        self._namespace = namespace
        self._given = dict(_pair(entry.strip()) for entry in given.split(",") if entry.strip())

    def of(self, topic: str) -> Rightful:
        """Return the rightful node of a topic in PUBLISHERS."""
        node, given = PUBLISHERS[topic], self._given
        name = given.get(topic) or given.get(node) or given.get("")
        if name is None:
            return Rightful(full_name(self._namespace, node), node != wiring.PLANT)
        if name == ANY:
            return Rightful(full_name(self._namespace, node), False)
        return Rightful(full_name(self._namespace, name), True)


def rightful_nodes(node: Node) -> RightfulNodes:
    """Declare the parameter `publishers` of a node and return the names. Raises ParameterError."""
    about = Text(
        "nodes that may publish topics of the control loop, where they have other names", ALLOWED
    )
    return RightfulNodes(node.get_namespace(), declared_text(node, PARAMETER, "", about))


def full_name(namespace: str, name: str) -> str:
    """Return the name of a node with its namespace; an absolute name is unchanged."""
    return name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"


def _pair(entry: str) -> tuple[str, str]:
    """Return topic or node, "" for all of them, and the name of the rightful node."""
    if entry == ANY:
        return "", ANY
    what, equals, name = (part.strip() for part in entry.partition("="))
    what = what.removeprefix("/")
    if not equals or not NAME.fullmatch(name.removeprefix("/")):
        raise ParameterError(f"{PARAMETER}: '{entry}'; allowed: {ALLOWED}")
    if what not in PUBLISHERS and what not in PUBLISHERS.values():
        nodes, names = dict.fromkeys(PUBLISHERS.values()), ", ".join(PUBLISHERS)
        raise ParameterError(
            f"{PARAMETER}: '{what}' is none of the nodes {', '.join(nodes)} and topics {names}"
        )
    return what, name
