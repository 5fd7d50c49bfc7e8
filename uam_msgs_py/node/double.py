"""A second node of one name: both would take each command. The later one ends at its start.

A killed process stays in the graph, but says nothing on /diagnostics any more.
"""

import time

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from uam_msgs_py.messages.status import texts_of
from uam_msgs_py.node.namespace import label

STARTED = "started [ns]"  # diagnostic value, wall clock
YOUNG = 10.0  # [s] after its start a node stays: another one may have stopped and gone on
ALIVE = 2  # reports, one a second: a node that ends sends one more at most


class Double:
    """Looks for another node with the name of `node`."""

    def __init__(self, node: Node) -> None:
        self.started = time.time_ns()
        self._node, self._begun, self._heard = node, time.monotonic(), 0
        self._name = node.get_name(), node.get_namespace()

    def seen(self) -> bool:
        """Return whether the graph has another node of this name."""
        return self._node.get_node_names_and_namespaces().count(self._name) > 1

    @property
    def young(self) -> bool:
        """Whether the node would end for another one."""
        return time.monotonic() - self._begun < YOUNG

    def note(self, message: DiagnosticArray) -> str:
        """Take a report of any node; return why this one ends, "" if it goes on."""
        for status in message.status:
            if status.name == label(self._node):
                started = int(texts_of(status).get(STARTED, self.started))
                self._heard += started < self.started
        if self._heard < ALIVE or not self.young:
            return ""
        return f"a node {self._node.get_fully_qualified_name()} runs already: end it first"
