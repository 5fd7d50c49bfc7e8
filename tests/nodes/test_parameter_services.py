"""Services of several nodes of one process are answered, one request per check."""

from contextlib import contextmanager
from functools import partial

import pytest
import rclpy
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import ListParameters, SetParameters, SetParametersAtomically
from rclpy.node import Node
from std_srvs.srv import Trigger

from uam_msgs_py.node import arrivals, other_entities
from uam_msgs_py.node.answering import ServingExecutor
from uam_msgs_py.node.other_entities import OtherEntities

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


@pytest.mark.parametrize("told", [True, False], ids=["told of requests", "asking all"])
def test_a_service_without_request_is_asked_only_where_nobody_tells(probe, monkeypatch, told):
    monkeypatch.setattr(other_entities, "FULL_PERIOD", 3600.0)
    if not told:  # as without compiled functions
        monkeypatch.setattr(arrivals, "_note", lambda: None)
    asked = []

    def answered(service):
        asked.append(service)
        return answer_it(service)

    answer_it = other_entities.answered
    monkeypatch.setattr(other_entities, "answered", answered)
    with served("quiet") as (nodes, rest):
        services = len(list(nodes[0].services))
        rest.serve(0)
        assert len(asked) == services  # at first a request may wait in each
        rest.serve(0)
        assert len(asked) == services * (1 if told else 2)
        client = probe.node.create_client(Trigger, "land")
        probe.until(client.service_is_ready, "land")
        futures = [client.call_async(Trigger.Request()) for _ in range(3)]

        def all_answered():
            rest.serve(0)
            return all(future.done() for future in futures)

        probe.until(all_answered, "three answers to three requests at once")
        assert [future.result().message for future in futures] == ["landing"] * 3
        asked.clear()
        rest.serve(0)
        assert bool(asked) is not told


def test_a_request_that_nobody_told_of_is_answered_within_a_second_or_two(probe, monkeypatch):
    monkeypatch.setattr(arrivals, "_tell", lambda *_: arrivals.OK)
    with served("untold") as (_, rest):
        rest.serve(0)
        assert answer(probe, partial(rest.serve, 0), Trigger.Request(), "land").message == "landing"


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
