"""Estimator, mission, controllers and bridge in one process: the fused layout.

    ros2 run uam_control flight_controller --ros-args --params-file parameters.yaml

The nodes are those of the separate layout, with the same names, parameters, services and topics.
They pass messages to each other without the middleware (`local_delivery`), in the order of
`control_tick.STAGES`, and send them when the setpoint has left. The node `flight_controller` has
the parameters of the process.

The process is the unit: when it ends, all of its nodes have ended, the bridge's heartbeats too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from uam_control.nodes.arm_controller import ArmControllerNode
from uam_control.nodes.attitude_controller import AttitudeControllerNode
from uam_control.nodes.mission import MissionNode
from uam_control.nodes.position_controller import PositionControllerNode
from uam_control.nodes.state_estimator import StateEstimatorNode
from uam_control.settings.parameter_set import ParameterError, ParameterSet, Text, number
from uam_control.stages.control_tick import STAGES
from uam_msgs_py.node import wiring
from uam_msgs_py.node.base_node import UamNode, run_together
from uam_msgs_py.node.local_delivery import LocalDelivery
from uam_msgs_py.node.node_parameters import NodeParameters, declared_text
from uam_msgs_py.node.own_endpoints import ignore_own_endpoints
from uam_msgs_py.node.tick_executor import TickExecutor
from uam_sim_bridge.nodes.mavlink_bridge import MavlinkBridgeNode

NAME = wiring.FLIGHT_CONTROLLER
KINDS: Mapping[str, Callable[[LocalDelivery], UamNode]] = dict(
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
# What of a node runs as a stage of `control_tick.STAGES`. The listeners of the sensors have run
# when the first node acts; the hand's stage runs with the arm law.
ACTS: Mapping[str, tuple[str, str] | None] = {
    "listeners of the sensors": None,
    "estimator": (wiring.ESTIMATOR, "settle"),
    "mission": (wiring.MISSION, "begin_ticks"),
    "position law": (wiring.POSITION, "settle"),
    "attitude law": (wiring.ATTITUDE, "settle"),
    "hand": None,
    "arm law": (wiring.ARM, "settle"),
    "bridge": (wiring.BRIDGE, "settle"),
    "next reference": (wiring.MISSION, "look_ahead"),
}


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
    """Parameters and diagnostics of the process; a tick is one pass of all nodes."""

    def __init__(self, delivery: LocalDelivery) -> None:
        super().__init__(NAME, delivery)
        self.delivery = delivery
        absent = Text("nodes that are not in this process", f"of {', '.join(KINDS)}; empty: none")
        given = declared_text(self, "without", "", absent)
        self.without = tuple(filter(None, (name.strip() for name in given.split(","))))
        unknown = [name for name in self.without if name not in KINDS]
        if unknown:
            raise ParameterError(f"without: '{unknown[0]}'; allowed: {absent.allowed}")
        self.parameter_set = NodeParameters(self, FlightControllerParameters)
        self.parameter_set.apply = lambda parameters: delivery.thin(parameters.inner_rate)
        self._last = self  # the node that acts last in a tick

    def connect(self, nodes: Sequence[UamNode]) -> None:
        """Connect the nodes of the process, in the order of the tick. Raises ParameterError."""
        self._last = nodes[-1] if nodes else self
        self.delivery.connect(nodes)
        self.delivery.thin(self.parameter_set.current.inner_rate)

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        level, summary, values = super().diagnose()
        inside = [name for name in KINDS if name not in self.without]
        values |= {
            "nodes": ", ".join(inside),
            "inner rate [Hz]": self.parameter_set.current.inner_rate or "every message",
            "own messages copied by the middleware": self.delivery.matched,
        }
        return level, summary, values

    def passed(self, begun: float) -> None:
        """Count a tick after the pass in which its last node acted; begun: see `done_tick`."""
        if self._last.stamp != self.stamp:
            self.done_tick(self._last.stamp, begun)


def make() -> list[UamNode]:
    """Return the nodes of the process, that of the process first. Raises ParameterError."""
    delivery = LocalDelivery()
    with ignore_own_endpoints():
        process = FlightControllerNode(delivery)
    nodes: dict[str, UamNode] = {}
    for name, kind in KINDS.items():
        if name not in process.without:
            try:
                nodes[name] = kind(delivery)
            except ValueError as error:  # ParameterError, ProfileError, ScenarioError ...
                raise ParameterError(f"{name}: {error}") from None
    process.connect(list(nodes.values()))
    return [process, *nodes.values()]


def steps(nodes: Sequence[UamNode]) -> list[Callable[[], None]]:
    """Return what one pass does: the stages of the tick, and what is sent between them.

    nodes: of `make`. After the bridge's stage the messages that other processes wait for are sent,
    all others at the end.
    """
    process, *acting = nodes
    by_name = {node.get_name(): node for node in acting}
    found: list[Callable[[], None]] = []
    for stage in STAGES:
        act = ACTS[stage.name]
        if act is None:
            continue
        name, method = act
        if name in by_name:
            found.append(getattr(by_name[name], method))
        if name == wiring.BRIDGE:
            found.append(process.times.measured(process.delivery.send_answers))
    return [*found, process.delivery.send]


def spin(
    nodes: Sequence[UamNode], running: Callable[[], bool], at_rest: Callable[[], None]
) -> None:
    """Spin the nodes of `make` until `running()` is false; at_rest: see `TickExecutor`."""
    process = nodes[0]
    TickExecutor(nodes, process.delivery, steps(nodes), process.passed, at_rest).spin(running)


def main() -> int:
    """Run the nodes; return the exit status."""
    return run_together(make, NAME, spin)
