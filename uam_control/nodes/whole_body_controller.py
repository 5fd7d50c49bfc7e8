"""The three controllers with a law of the whole body, in one process: `whole_body_controller`.

    ros2 run uam_control whole_body_controller --ros-args --params-file parameters.yaml

The nodes are position_controller, attitude_controller and arm_controller, with their parameters,
services and topics. In flight the position's computes all three outputs of a tick; the others
publish theirs when its command arrives. The node `whole_body_controller` beside the three has what
concerns the law as a whole.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from std_srvs.srv import SetBool, Trigger

from uam_control.nodes.arm_controller import ArmControllerNode
from uam_control.nodes.attitude_controller import AttitudeControllerNode
from uam_control.nodes.controller_node import FREEZE, RESET, ControllerNode
from uam_control.nodes.position_controller import PositionControllerNode
from uam_control.settings.parameter_set import ParameterError
from uam_control.stages.law_stages import WholeBodyPart, WholeBodyStage
from uam_msgs_py.messages.node_names import WHOLE_BODY
from uam_msgs_py.node.answering import offer
from uam_msgs_py.node.base_node import UamNode, run_together
from uam_msgs_py.node.executor import spin as spin_nodes


class WholeBodyNode(UamNode):
    """Services and diagnostics of the law as a whole; a tick is one of all three controllers."""

    def __init__(self, parts: Sequence[ControllerNode]) -> None:
        """parts: the controllers, in the order in which they act in a tick."""
        super().__init__(WHOLE_BODY)
        self._parts = tuple(parts)
        offer(self, Trigger, f"~/{RESET}", lambda: _together([one.reset() for one in parts]))
        offer(self, SetBool, f"~/{FREEZE}", lambda on: _together([one.freeze(on) for one in parts]))

    def settle(self) -> None:
        """Count the ticks of the controllers."""
        self.stamp, self.ticks = self._parts[-1].stamp, self._parts[-1].ticks

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        level, summary, values = super().diagnose()
        law = self._parts[0].controller.law
        values |= {
            "law": law.parameters.law,
            "nodes": ", ".join(node.get_name() for node in self._parts),
            "frozen": ", ".join(n.get_name() for n in self._parts if n.controller.law.frozen),
        }
        return level, summary, values


def _together(answers: Sequence[tuple[bool, str]]) -> tuple[bool, str]:
    """Return the answers of all controllers as one."""
    done, texts = zip(*answers, strict=True)
    return all(done), "; ".join(texts)


def make() -> list[UamNode]:
    """Return the nodes of the process. Raises ParameterError."""
    nodes = [PositionControllerNode(), AttitudeControllerNode(), ArmControllerNode()]
    join(nodes)
    return [*nodes, WholeBodyNode(nodes)]


def join(nodes: Sequence[ControllerNode]) -> None:
    """Let the three nodes fly one law, see the module. Raises ParameterError."""
    for node in nodes:
        law = node.controller.law
        if not law.whole:
            name = law.parameters.law
            raise ParameterError(f"{node.get_name()}: law: {name} is none of the whole body")
    compile_whole(nodes)
    whole = WholeBodyStage([node.stage for node in nodes])
    for number, node in enumerate(nodes):
        node.stage = WholeBodyPart(whole, number)


def compile_whole(nodes: Sequence[ControllerNode]) -> None:
    """Run the law of the three nodes once: the first call takes a second."""
    nothing = np.zeros((3, len(nodes[0].vehicle.coordinates)))
    WholeBodyStage([node.spare for node in nodes]).update(0, nothing, nothing)


def spin(
    nodes: Sequence[UamNode], running: Callable[[], bool], at_rest: Callable[[], None]
) -> None:
    """Spin the nodes of `make` until `running()` is false; at_rest: see `LeanExecutor`."""
    spin_nodes(nodes, running, min(node.wake_up for node in nodes), at_rest)


main = partial(run_together, make, WHOLE_BODY, spin)  # returns the exit status
