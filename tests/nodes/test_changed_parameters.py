"""A restarted node receives the parameters that were changed in flight."""

import pytest
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter

from uam_lab.flight.ros.restarts import ChangedParameters
from uam_msgs_py.messages.parameter_changes import ParameterChange


class Silent:
    """A node without middleware: the test passes the messages."""

    def create_subscription(self, *_, **__):
        return None


@pytest.mark.parametrize("namespace", ["/", "/uav1"])
def test_the_newest_accepted_values_come_back_as_ros_arguments(namespace, tmp_path):
    changed = ChangedParameters(Silent())
    assert changed.arguments("arm_controller") == []
    for values, reason in (
        ({"rho_0": (1.0, 2.5), "phi": ([1.0, 1.0], [1e-7, 3.0])}, ""),
        ({"rho_0": (2.5, 1e-12)}, ""),
        ({"rho_0": (1e-12, -1.0)}, "rho_0: -1 is outside"),
        ({"law": ("modular", "pid"), "integral": (True, False), "K": (3, 4)}, ""),
    ):
        changed.note(ParameterChange("arm_controller", "set_parameters", values, reason))
    changed.note(ParameterChange("mission", "set_parameters", {"tilt_hold": (0.8, 0.7)}))
    context = rclpy.Context()
    file = tmp_path / "parameters.yaml"
    file.write_text("arm_controller: {ros__parameters: {rho_0: 5.0, law: asmc1}}")
    arguments = [
        "--ros-args",
        "-p",
        "of_every_node:=x",
        "--params-file",
        str(file),
    ]  # as a flight's
    arguments += ["-r", f"__ns:={namespace}", *changed.arguments("arm_controller")]
    rclpy.init(args=arguments, context=context)
    node = Node(
        "arm_controller", context=context, automatically_declare_parameters_from_overrides=True
    )
    found = {name: node.get_parameter(name) for name in ("rho_0", "phi", "law", "integral", "K")}
    node.destroy_node()
    context.shutdown()
    assert {name: one.value for name, one in found.items()} | {"phi": list(found["phi"].value)} == {
        "rho_0": 1e-12,
        "phi": [1e-7, 3.0],
        "law": "pid",
        "integral": False,
        "K": 4,
    }
    assert found["rho_0"].type_ == Parameter.Type.DOUBLE
