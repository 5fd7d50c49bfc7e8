"""The magnet on an output of the autopilot: /uam/magnet → commands of the bridge's link."""

from __future__ import annotations

import time

from uam_control.offboard.autopilot_magnet import (
    NONE,
    AutopilotMagnet,
    AutopilotMagnetParameters,
)
from uam_msgs_py.node.base_node import UamNode
from uam_msgs_py.node.node_parameters import NodeParameters
from uam_sim_bridge.devices.magnet.magnet_driver import SwitchingParameters
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.nodes.magnet_topics import MagnetTopics

EXIT_TIME = 1.0  # [s] for the acknowledgement at the node's end
EXIT_STEP = 0.02  # [s] between two looks for it


class BridgeMagnet:
    """Joins commands, link and state. Times [s] are those of the ticks."""

    def __init__(
        self, node: UamNode, link: OffboardLink, magnet: AutopilotMagnet, rules: SwitchingParameters
    ) -> None:
        self._node, self._link, self._magnet = node, link, magnet
        self._time = 0.0
        self._topics = MagnetTopics(node, rules, lambda: self._time)

    def update(self, tick: float) -> None:
        """Take the commands that have arrived by `tick`, and publish the state."""
        self._time = tick
        self._node.take_waiting(self._topics.subscription)
        self._magnet.switch(tick, self._topics.switching.desired(tick))
        self._topics.publish(tick, self._magnet.state)

    def end(self, tick: float) -> None:
        """Leave the magnet as `magnet_at_exit` says; wait at most EXIT_TIME for the answer.

        tick: the last one. An autopilot that never answered is not waited for.
        """
        self._magnet.switch(tick, self._topics.switching.at_exit())
        begun = time.monotonic()
        while not self._magnet.settled and (spent := time.monotonic() - begun) < EXIT_TIME:
            if not self._link.connected(tick + spent):
                return
            self._link.send_magnet(tick + spent)
            time.sleep(EXIT_STEP)
            self._link.poll(tick + spent)

    def problems(self) -> tuple[str, ...]:
        """Return one line per problem."""
        found = (self._magnet.problem, self._topics.problem(self._time))
        return tuple(text for text in found if text)

    def values(self) -> dict[str, object]:
        """Return the values for /diagnostics."""
        return {"magnet": self._magnet.state, "magnet commands sent": self._magnet.requests}


def bridge_magnet(node: UamNode, link: OffboardLink) -> BridgeMagnet | None:
    """Declare the parameters and return the magnet; None if it is not the autopilot's."""
    parameters = NodeParameters(node, AutopilotMagnetParameters, read_only=True).current
    rules = NodeParameters(node, SwitchingParameters, read_only=True).current
    if parameters.magnet == NONE:
        return None
    link.magnet = AutopilotMagnet(parameters)
    return BridgeMagnet(node, link, link.magnet, rules)
