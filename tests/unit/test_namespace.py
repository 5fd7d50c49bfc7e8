"""Names in a namespace."""

import pytest

from uam_msgs_py.node import namespace


@pytest.mark.parametrize(
    ("given", "full"),
    [("", "/"), ("/", "/"), ("uav1", "/uav1"), ("/uav1", "/uav1"), ("lab/uav_1", "/lab/uav_1")],
)
def test_a_namespace_has_one_form(given, full):
    assert namespace.normal(given) == full


@pytest.mark.parametrize("given", ["1uav", "uav 1", "a//b", "uav1/", "//uav1", "uav-1", "ü"])
def test_an_invalid_namespace_is_refused_in_one_line(given):
    with pytest.raises(ValueError, match="allowed are letters, digits") as refusal:
        namespace.normal(given)
    assert "\n" not in str(refusal.value) and given in str(refusal.value)


def test_topics_move_and_absolute_ones_stay():
    assert namespace.expanded("/", "uam/state") == "/uam/state"
    assert namespace.expanded("/uav1", "uam/state") == "/uav1/uam/state"
    assert namespace.expanded("/uav1", "/tf") == "/tf"


def test_a_status_belongs_to_the_nodes_of_its_own_namespace():
    assert namespace.unlabelled("/", "mission") == "mission"
    assert namespace.unlabelled("/", "uav1/mission") is None
    assert namespace.unlabelled("/uav1", "uav1/mission") == "mission"
    assert namespace.unlabelled("/uav1", "uav11/mission") is None
    assert namespace.unlabelled("/uav1", "mission") is None
