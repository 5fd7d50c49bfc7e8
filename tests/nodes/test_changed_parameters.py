"""A restarted node receives the parameters that were changed in flight."""

import os

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.parameter import Parameter

from uam_lab.flights.ros.supervise import ChangedParameters, StatusListener
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.flight_events import ParameterChange
from uam_msgs_py.messages.status import MissionStatus
from uam_msgs_py.node.door import Door


class Silent:
    """A node without middleware: the test passes the messages."""

    def create_subscription(self, *_, **__):
        return None

    def get_namespace(self):
        return "/"


@pytest.mark.parametrize("namespace", ["/", "/uav1"])
def test_the_newest_accepted_values_come_back_as_ros_arguments(namespace, tmp_path):
    changed = ChangedParameters(Silent(), Door(Silent()))
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


def test_a_message_of_something_else_is_skipped_and_said(probe, domain, capfd):
    change = ParameterChange("probe", "x", {"tilt_hold": (0.8, 0.7)}).to_message(1)
    foreign = ParameterChange("mission", "x", {"tilt_hold": (0.8, 0.7)}).to_message(1)
    good = {topics.CHANGES: change, topics.MISSION_STATUS: MissionStatus().to_message(1)}
    names = [f"/{topic.name}" for topic in (*good, topics.AUTOPILOT_STATE)]
    said = []
    with StatusListener(os.environ, domain, publishers="any") as listener:
        changed = ChangedParameters(listener.node, listener.door)
        publishers = {topic: probe.publisher(topic) for topic in (*good, topics.AUTOPILOT_STATE)}

        def all_said():
            for publisher in publishers.values():
                publisher.publish(DiagnosticArray())
            changed.poll()
            assert listener.poll() == []
            said.append(capfd.readouterr().err)
            return all(f"{name}: message refused: " in "".join(said) for name in names)

        def received():
            # again: a message may arrive before the middleware knows who publishes
            for topic, message in good.items():
                publishers[topic].publish(message)
            changed.poll()
            listener.poll()
            return listener.newest and changed.arguments("probe")

        probe.until(all_said, "a line for each topic")
        publishers[topics.CHANGES].publish(foreign)
        probe.until(received, "the good messages")
        assert changed.arguments("mission") == [], "the probe is not the mission"
