"""Estimator, mission, controllers and bridge in one process: the fused layout.

    ros2 run uam_control flight_controller --ros-args --params-file parameters.yaml

The nodes are those of the separate layout, with the same names, parameters, services and topics.
Their stages run as one list, see `fused_tick`. Without one of the nodes, or with another publisher
of a topic between them, they pass each other messages as separate nodes do. The node
`flight_controller` has the parameters of the process.

The process is the unit: when it ends, all of its nodes have ended, the bridge's heartbeats too.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from uam_control.nodes import whole_body_controller
from uam_control.nodes.arm_controller import ArmControllerNode
from uam_control.nodes.attitude_controller import AttitudeControllerNode
from uam_control.nodes.mission import MissionNode
from uam_control.nodes.position_controller import PositionControllerNode
from uam_control.nodes.state_estimator import StateEstimatorNode
from uam_control.settings.parameter_set import ParameterError, ParameterSet, Text, number
from uam_msgs_py.node import wiring
from uam_msgs_py.node.base_node import UamNode, run_together
from uam_msgs_py.node.executor import spin as spin_nodes
from uam_msgs_py.node.node_parameters import NodeParameters, declared_text
from uam_sim_bridge.nodes.fused_tick import FusedTick, is_whole
from uam_sim_bridge.nodes.mavlink_bridge import MavlinkBridgeNode

NAME = wiring.FLIGHT_CONTROLLER
KINDS: Mapping[str, Callable[[], UamNode]] = dict(
    zip(
        wiring.FUSED,
        (
            *(StateEstimatorNode, MissionNode),
            *(PositionControllerNode, AttitudeControllerNode, ArmControllerNode),
            MavlinkBridgeNode,
        ),
        strict=True,
    )
)


@dataclass(frozen=True)
class FlightControllerParameters(ParameterSet):
    """What the process sends of its inner topics."""

    inner_rate: float = number(
        0.0,
        "messages per second of stamps that are sent of each topic that only nodes of this process "
        "need: for recording and displays, 0: every message",
        "Hz",
        0.0,
        1000.0,
    )


class FlightControllerNode(UamNode):
    """Parameters and diagnostics of the process; a tick is a whole pass through the stages."""

    def __init__(self) -> None:
        super().__init__(NAME)
        absent = Text("nodes that are not in this process", f"of {', '.join(KINDS)}; empty: none")
        given = declared_text(self, "without", "", absent)
        self.without = tuple(filter(None, (name.strip() for name in given.split(","))))
        unknown = [name for name in self.without if name not in KINDS]
        if unknown:
            raise ParameterError(f"without: '{unknown[0]}'; allowed: {absent.allowed}")
        self.parameter_set = NodeParameters(self, FlightControllerParameters)
        self.parameter_set.apply = self._thin
        self.fused: FusedTick | None = None
        self._last: UamNode = self  # the node that acts last in a tick

    def join(self, nodes: Mapping[str, UamNode]) -> None:
        """Join the nodes of the process to one tick, if they are a whole one."""
        self._last = [self, *nodes.values()][-1]
        laws = [nodes[name] for name in wiring.CONTROLLERS if name in nodes]
        if is_whole(nodes):
            self.fused = FusedTick(self, nodes)
        elif any(node.controller.law.whole for node in laws):
            if len(laws) < len(wiring.CONTROLLERS):
                raise ParameterError("without: a law of the whole body needs all controllers")
            whole_body_controller.join(laws)
        self._thin(self.parameter_set.current)

    def _thin(self, parameters: FlightControllerParameters) -> None:
        if self.fused is not None:
            self.fused.thin(parameters.inner_rate)
        elif parameters.inner_rate:
            self.get_logger().warning("inner_rate: every message is sent, this is no whole tick")

    def settle(self) -> None:
        """Run the ticks whose samples have arrived; see `FusedTick`."""
        if self.fused is not None:
            self.fused.settle()
        else:
            self.stamp, self.ticks = self._last.stamp, self._last.ticks

    @property
    def dropped(self) -> int:
        return self.fused.dropped if self.fused is not None else 0

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        level, summary, values = super().diagnose()
        inside = [name for name in KINDS if name not in self.without]
        values |= {
            "nodes": ", ".join(inside),
            "inner rate [Hz]": self.parameter_set.current.inner_rate or "every message",
            "one tick": self.fused is not None,
        }
        return level, summary, values


def make() -> list[UamNode]:
    """Return the nodes of the process, that of the process first. Raises ParameterError."""
    process = FlightControllerNode()
    nodes: dict[str, UamNode] = {}
    for name, kind in KINDS.items():
        if name not in process.without:
            try:
                nodes[name] = kind()
            except ValueError as error:  # ParameterError, ProfileError, ScenarioError ...
                raise ParameterError(f"{name}: {error}") from None
    process.join(nodes)
    laws = [nodes[name] for name in wiring.CONTROLLERS if name in nodes]
    if any(node.controller.law.whole for node in laws):
        nodes[wiring.WHOLE_BODY] = whole_body_controller.WholeBodyNode(laws)
    return [process, *nodes.values()]


def spin(
    nodes: Sequence[UamNode], running: Callable[[], bool], at_rest: Callable[[], None]
) -> None:
    """Spin the nodes of `make` until `running()` is false; at_rest: see `LeanExecutor`."""
    fused, wake_up = nodes[0].fused, min(node.wake_up for node in nodes)
    often = {} if fused is None else {"often": fused.often}
    spin_nodes(nodes, running, wake_up, at_rest, **often)


def main() -> int:
    return run_together(make, NAME, spin)
