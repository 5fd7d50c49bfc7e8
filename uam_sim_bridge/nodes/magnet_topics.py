"""Commands of the magnet in, its state out: for the bridge and for the driver of a line."""

from collections.abc import Callable

from std_msgs.msg import Bool

from uam_msgs_py.messages import topics
from uam_msgs_py.node.base_node import UamNode
from uam_sim_bridge.devices.magnet.lines import MagnetSwitching, SwitchingParameters

STATE_PERIOD = 1.0  # [s] between two messages of an unchanged state


class MagnetTopics:
    """`switching`: the desired state by the commands so far."""

    def __init__(
        self, node: UamNode, parameters: SwitchingParameters, now: Callable[[], float]
    ) -> None:
        """now: the time [s] at which a command arrives."""
        self.switching = MagnetSwitching(parameters)
        self.subscription = node.listen(
            topics.MAGNET, lambda message: self.switching.command(now(), message.data)
        )
        self._publisher = node.publisher(topics.MAGNET_STATE)
        self._published: bool | None = None
        self._due = 0.0

    def publish(self, time: float, state: bool | None) -> None:
        """Publish the state when it changes, and once per STATE_PERIOD; None: it is unknown."""
        if state is None:
            self._published = None
        elif state is not self._published or time >= self._due:
            self._published, self._due = state, time + STATE_PERIOD
            self._publisher.publish(Bool(data=state))

    def problem(self, time: float) -> str:
        """Return one line if commands are lost, else ""."""
        if not self.switching.stale(time):
            return ""
        word = "on" if self.switching.desired(time) else "off"
        return f"magnet {word}: commands are lost"
