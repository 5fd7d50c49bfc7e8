"""A profile in flight when a node stops answering: the others get their old values back."""

from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import parameter_value_to_python

from uam_lab.flights.operator import NoFlight
from uam_lab.flights.ros.profile_switch import (
    APPLY,
    NO_RESPONSE,
    NOT_FOUND,
    ProfileSwitch,
    SwitchIncomplete,
    SwitchRefused,
)


class Nodes(ProfileSwitch):
    """Nodes with a parameter `gain`, 1.0; `silent` does not answer APPLY, once or always."""

    def __init__(self, silent: str, answers_again: bool) -> None:
        self.gains = {"one": 1.0, "two": 1.0, "three": 1.0}
        self._silent, self._again = silent, answers_again

    def _current(self, desired):
        return {node: {"gain": self.gains[node]} for node in desired}

    def _call(self, kind, service, requests):
        assert kind is SetParametersAtomically
        missing = [node for node in requests if service == APPLY and node == self._silent]
        if missing and self._again:
            self._silent = ""
        answers = {}
        for node, request in requests.items():
            if service == APPLY and node not in missing:
                (parameter,) = request.parameters
                self.gains[node] = parameter_value_to_python(parameter.value)
            if node not in missing:
                answers[node] = SimpleNamespace(result=SimpleNamespace(successful=True, reason=""))
        return answers, dict.fromkeys(missing, NO_RESPONSE)


WANTED = {node: {"gain": 2.0} for node in ("one", "two", "three")}


def test_the_others_get_their_old_values_back():
    nodes = Nodes("two", answers_again=True)
    with pytest.raises(SwitchRefused, match=r"^two: no response$") as refused:
        nodes.change(WANTED)
    assert not isinstance(refused.value, SwitchIncomplete)
    assert set(nodes.gains.values()) == {1.0}


def test_a_node_that_stays_silent_is_named_and_does_not_keep_the_others_from_their_values():
    nodes = Nodes("two", answers_again=False)
    with pytest.raises(SwitchIncomplete) as refused:
        nodes.change(WANTED)
    assert str(refused.value).splitlines() == [
        "two: no response",
        "two: may have the new values: no response",
    ]
    assert set(nodes.gains.values()) == {1.0}


class Alone(ProfileSwitch):
    """`there`: the nodes that exist."""

    def __init__(self, *there: str) -> None:
        self._there = there
        self._node = SimpleNamespace(
            context=SimpleNamespace(get_domain_id=lambda: 7),
            resolve_service_name=lambda name: f"/uav2/{name}",
        )

    def _call(self, kind, service, requests):
        return {}, {node: NOT_FOUND for node in requests if node not in self._there}


def test_without_any_node_there_is_no_flight_and_nothing_that_refuses():
    with pytest.raises(NoFlight, match=r"^no node /uav2/one, /uav2/two, .* in ROS domain 7: start"):
        Alone().change(WANTED)
    with pytest.raises(SwitchRefused, match="^two: service not found\nthree: service not found$"):
        Alone("one").change(WANTED)
