"""Base class of nodes whose parameters can be changed in flight; it publishes every request.

| service | does |
|---|---|
| `~/set_parameters`, `~/set_parameters_atomically` | rclpy's, plus a message per request |
| `~/check_parameters` | only checks: would `~/set_parameters_atomically` accept? |

Services are served between two ticks, see `executor`.
"""

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter

from uam_control.settings.texts import visible
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.flight_events import ParameterChange
from uam_msgs_py.node.door import Door
from uam_msgs_py.node.namespace import adopt_sections
from uam_msgs_py.node.node_parameters import NodeParameters

SERVICE = "parameter service"
CHECK = "check_parameters"


class TunableNode(Node):
    """Publishes each change of its parameters, accepted or refused, on /uam/parameter_changes."""

    def __init__(self, name: str):
        super().__init__(name)
        adopt_sections(self)
        self.stamp = 0  # [ns] of the newest tick
        self.door = Door(self)
        self._changes = topics.CHANGES.outlet(self)
        self.create_service(SetParametersAtomically, f"~/{CHECK}", self._on_check)

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Change all parameters or none, between two ticks; called by rclpy's services."""
        return self.change_parameters(parameter_list, SERVICE)

    def set_parameters(self, parameter_list: list[Parameter]) -> list[SetParametersResult]:
        """Change the parameters one by one; each may be refused."""
        return [self.set_parameters_atomically([item]) for item in parameter_list]

    def change_parameters(self, changes: list[Parameter], by: str) -> SetParametersResult:
        """Change all or none and publish the result; by: origin of the request."""
        known = [change.name for change in changes if self.has_parameter(change.name)]
        old = {name: self.get_parameter(name).value for name in known}
        result = self.check_parameters(changes)
        if result.successful:
            result = super().set_parameters_atomically(changes)
        if not result.successful:
            self.get_logger().warning(f"refused, old values stay in effect: {result.reason}")
        values = {change.name: (old.get(change.name), change.value) for change in changes}
        self.publish_change(
            ParameterChange(self.get_name(), by, values, "" if result.successful else result.reason)
        )
        return result

    def check_parameters(self, changes: list[Parameter]) -> SetParametersResult:
        """Return whether these changes as a whole are valid, with the reason if not."""
        for name in (change.name for change in changes):
            if not self.has_parameter(name):
                return _refusal(f"{name}: unknown")
            if self.describe_parameter(name).read_only:
                return _refusal(f"{name}: read-only, fixed once the node runs")
        for check in self._on_set_parameters_callbacks:
            # others act at once: that of rclpy begins simulated time
            if isinstance(getattr(check, "__self__", None), NodeParameters):
                result = check(changes)
                if not result.successful:
                    return result
        return SetParametersResult(successful=True)

    def publish_change(self, change: ParameterChange) -> None:
        """Publish a change, with the stamp of the newest tick."""
        self._changes.publish(change.to_message(self.stamp))

    def _on_check(
        self, request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        changes = [Parameter.from_parameter_msg(item) for item in request.parameters]
        response.result = self.check_parameters(changes)
        return response


def _refusal(reason: str) -> SetParametersResult:
    return SetParametersResult(successful=False, reason=visible(reason))
