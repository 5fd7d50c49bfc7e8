"""A profile in flight when a node stops answering: the others get their old values back."""

from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import parameter_value_to_python

from uam_lab.flight.ros.profile_switch import (
    APPLY,
    NO_RESPONSE,
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
