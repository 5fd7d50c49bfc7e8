"""Names in a namespace."""

import sys
from types import SimpleNamespace

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


FILES = {
    "of all": "/**: {ros__parameters: {tilt_max: 0.2}}",
    "bare": "position_controller: {ros__parameters: {tilt_max: 0.2}}",
    "absolute": "/position_controller: {ros__parameters: {tilt_max: 0.2}}",
    "full": "/uav1/position_controller: {ros__parameters: {tilt_max: 0.2}}",
    "nested": "uav1: {position_controller: {ros__parameters: {tilt_max: 2e-1}}}",
    "other": "uav2: {position_controller: {ros__parameters: {tilt_max: 0.2}}}",
}
FOUND, NOTHING = {"tilt_max": 0.2}, {}


@pytest.mark.parametrize(
    ("where", "space", "found"),
    [
        *((where, "/uav1", FOUND) for where in ("of all", "bare", "absolute", "full", "nested")),
        *((where, "/uav1", NOTHING) for where in ("other", "command line")),
        *((where, "/", FOUND) for where in ("of all", "bare", "absolute", "command line")),
        *((where, "/", NOTHING) for where in ("full", "nested", "other")),
    ],
)
def test_a_neighbours_parameters_are_found_where_ros_finds_them(
    where, space, found, tmp_path, monkeypatch
):
    file = tmp_path / "parameters.yaml"
    file.write_text(FILES.get(where, ""))
    given = ["--params-file", str(file)]
    if where == "command line":
        given += ["-p", "position_controller:tilt_max:=2e-1", "-p", "mission:tilt_max:=0.3"]
    monkeypatch.setattr(sys, "argv", ["mission", "--ros-args", *given])
    node = SimpleNamespace(get_namespace=lambda: space)
    assert namespace.neighbour_section(node, "position_controller") == found


def test_a_parameter_of_every_node_may_be_unknown_to_one(tmp_path, monkeypatch):
    refuse_unknown = pytest.importorskip("uam_msgs_py.node.node_parameters").refuse_unknown
    file = tmp_path / "parameters.yaml"
    file.write_text("/**: {ros__parameters: {vehicle: s500_arm}}")
    monkeypatch.setattr(sys, "argv", ["recorder", "--ros-args", "--params-file", str(file)])
    given = {"vehicle": SimpleNamespace(value="s500_arm")}
    node = SimpleNamespace(
        _parameter_overrides=given,
        has_parameter=lambda _: False,
        get_parameters_by_prefix=lambda _: {},
    )
    refuse_unknown(node)
    given["vehicles"] = given["vehicle"]
    with pytest.raises(ValueError, match="vehicles: unknown"):
        refuse_unknown(node)
