"""Services of several nodes of one process are answered, one request per check."""

import rclpy
from rcl_interfaces.srv import ListParameters
from rclpy.node import Node
from std_srvs.srv import Trigger

from uam_msgs_py.node.other_entities import OtherEntities

NAMES = ("first", "second", "third")


def landing(_, response):
    response.message = "landing"
    return response


def answer(probe, rest, kind, name):
    """Return the answer of a service that `rest` serves."""
    client = probe.node.create_client(kind, name)
    probe.until(client.service_is_ready, name)
    future = client.call_async(kind.Request())

    def answered():
        rest.serve(0)
        return future.done()

    probe.until(answered, f"answer of {name}")
    return future.result()


def test_the_services_of_every_node_are_answered(probe):
    context = rclpy.Context()
    rclpy.init(context=context)
    nodes = [Node(name, context=context) for name in NAMES]
    nodes[0].create_service(Trigger, "land", landing)
    rest = OtherEntities(nodes)
    try:
        for name in (*NAMES, *NAMES):
            parameters = answer(probe, rest, ListParameters, f"{name}/list_parameters")
            assert "use_sim_time" in parameters.result.names
            assert answer(probe, rest, Trigger, "land").message == "landing"
    finally:
        rest.shutdown()
        for node in nodes:
            node.destroy_node()
        context.try_shutdown()
