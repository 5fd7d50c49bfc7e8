"""A mission of an earlier flight is still in the ROS domain: the next flight waits for its end."""

import pytest
import rclpy
from rclpy.node import Node
from whole_flight import Flight

from uam_lab.flights.processes.node_environment import ros_environment
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.status import MissionStatus
from uam_msgs_py.node import wiring
from uam_sim_bridge.ports import Reservation

OVER = MissionStatus(phase="landed", time=9.0, done=True)


@pytest.fixture
def left_over(tmp_path, monkeypatch):
    """A node named as the mission; its latched status says that the flight is over."""
    with Reservation(namespace="/test") as reserved:  # the flight has "/" in this domain
        domain = reserved.ports.domain
        for name, value in ros_environment(domain, tmp_path).items():
            monkeypatch.setenv(name, value)
        context = rclpy.Context()
        rclpy.init(context=context, domain_id=domain)
        node = Node(wiring.MISSION, context=context, start_parameter_services=False)
        topic = topics.MISSION_STATUS
        node.create_publisher(topic.type, topic.name, topic.qos).publish(
            OVER.to_message(9_000_000_000)
        )
        node.domain = domain
        yield node
        rclpy.try_shutdown(context=context)


def test_the_next_flight_waits_for_its_end_and_is_not_ended_by_its_status(
    left_over, tmp_path, short_scenario
):
    domain = str(left_over.domain)
    flight = Flight(
        tmp_path / "f", "--fused", "--scenario", str(short_scenario), "--domain", domain
    )
    try:
        plant = flight.out / "logs" / "mujoco_sim.log"
        named = "one of the two nodes named mission that publish /uam/mission/status to end"
        flight.until(lambda: plant.exists() and named in plant.read_text(), "it to be named")
        left_over.destroy_node()
        assert flight.wait() == 0, flight.said + flight.complained
    finally:
        flight.end()
