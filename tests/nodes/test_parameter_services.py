"""Services of several nodes of one process are answered, one request per check."""

from contextlib import contextmanager
from functools import partial

import pytest
import rclpy
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import ListParameters, SetParameters, SetParametersAtomically
from rclpy.node import Node
from std_srvs.srv import Trigger

from uam_msgs_py.node import other_entities
from uam_msgs_py.node.answering import ServingExecutor
from uam_msgs_py.node.other_entities import TURNS, OtherEntities

NAMES = ("first", "second", "third")
KINDS = (ListParameters, SetParameters, SetParametersAtomically, Trigger)


def landing(_, response):
    response.message = "landing"
    return response


@contextmanager
def served(*names):
    """Nodes of these names with what serves them; the first one has the service `land`."""
    context = rclpy.Context()
    rclpy.init(context=context)
    nodes = [Node(name, context=context) for name in names]
    nodes[0].create_service(Trigger, "land", landing)
    rest = OtherEntities(nodes)
    try:
        yield nodes, rest
    finally:
        rest.shutdown()
        for node in nodes:
            node.destroy_node()
        context.try_shutdown()


def answer(probe, serve, request, name):
    """Return the answer of a service that `serve()` serves."""
    kind = next(one for one in KINDS if isinstance(request, one.Request))
    client = probe.node.create_client(kind, name)
    probe.until(client.service_is_ready, name)
    future = client.call_async(request)

    def answered():
        serve()
        return future.done()

    probe.until(answered, f"answer of {name}")
    return future.result()


def test_the_services_of_every_node_are_answered(probe):
    with served(*NAMES) as (_, rest):
        serve = partial(rest.serve, 0)
        for name in (*NAMES, *NAMES):
            parameters = answer(probe, serve, ListParameters.Request(), f"{name}/list_parameters")
            assert "use_sim_time" in parameters.result.names
            assert answer(probe, serve, Trigger.Request(), "land").message == "landing"


def test_services_of_parameters_take_turns_and_others_are_asked_at_every_check(probe, monkeypatch):
    asked = []

    def answered(service):
        asked.append(service)
        return answer_it(service)

    answer_it = other_entities.answered
    monkeypatch.setattr(other_entities, "answered", answered)
    with served("quiet", "calm") as (nodes, rest):
        (land,) = (one for one in nodes[0].services if one.service_name.endswith("/land"))
        for _ in range(TURNS):
            rest.serve(0)
        assert asked.count(land) == TURNS
        others = [one for node in nodes for one in node.services if one is not land]
        assert len(others) >= 12 and all(asked.count(one) == 1 for one in others)
        client = probe.node.create_client(Trigger, "land")
        probe.until(client.service_is_ready, "land")
        futures = [client.call_async(Trigger.Request()) for _ in range(3)]

        def all_answered():
            rest.serve(0)
            return all(future.done() for future in futures)

        probe.until(all_answered, "three answers to three requests at once")
        assert [future.result().message for future in futures] == ["landing"] * 3


@pytest.mark.parametrize("name", ["set_parameters", "set_parameters_atomically"])
@pytest.mark.parametrize("by_rclpy", [False, True], ids=["between two ticks", "by rclpy"])
def test_a_parameter_of_an_unknown_type_ends_no_node(probe, name, by_rclpy, capfd):
    kind = {"set_parameters": SetParameters}.get(name, SetParametersAtomically)
    unknown = Parameter(name="use_sim_time", value=ParameterValue(type=42))
    request = kind.Request(parameters=[unknown])
    with served("asked") as (nodes, rest):
        executor = ServingExecutor(context=nodes[0].context)
        executor.add_node(nodes[0])
        serve = partial(executor.spin_once, 0.0) if by_rclpy else partial(rest.serve, 0)
        result = answer(probe, serve, request, f"asked/{name}")
        assert result == kind.Response(), "nothing was set"
        assert f"/asked/{name}: request refused: ValueError" in capfd.readouterr().err
        assert answer(probe, serve, Trigger.Request(), "land").message == "landing"
        executor.shutdown()
