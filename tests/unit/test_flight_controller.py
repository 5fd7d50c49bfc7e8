"""The fused layout: its settings."""

import pytest

pytest.importorskip("rclpy")

from uam_lab.flights import flight_settings
from uam_lab.flights.flight_settings import SettingsError
from uam_lab.flights.ros import node_arguments
from uam_lab.records.results.result_folder import ResultFolder
from uam_msgs_py.node import wiring


def settings(**given):
    return flight_settings.settings(scenario="hover", **given)


def test_one_process_has_the_control_nodes():
    fused, separate = settings(fused=True), settings()
    found = node_arguments.modules(fused)
    assert found[wiring.FLIGHT_CONTROLLER] == node_arguments.FUSED
    assert not set(wiring.FUSED) & found.keys()
    assert found.keys() - {wiring.FLIGHT_CONTROLLER} == (
        node_arguments.modules(separate).keys() - set(wiring.FUSED)
    )
    assert node_arguments.nodes_in(wiring.FLIGHT_CONTROLLER, fused) == wiring.FUSED
    assert fused.layout != separate.layout


def test_a_law_of_the_whole_body_has_one_process_for_its_controllers():
    whole = settings(controller="whole_body_l1")
    found = node_arguments.modules(whole)
    assert found[wiring.WHOLE_BODY] == "uam_control.nodes.whole_body_controller"
    inside = (wiring.POSITION, wiring.ATTITUDE, wiring.ARM)
    assert not set(inside) & found.keys()
    assert node_arguments.nodes_in(wiring.WHOLE_BODY, whole) == inside
    fused = node_arguments.modules(settings(controller="whole_body_l1", fused=True))
    assert wiring.WHOLE_BODY not in fused and wiring.FLIGHT_CONTROLLER in fused
    with pytest.raises(SettingsError, match="without arm_controller: whole_body_l1 is one law"):
        settings(controller="whole_body_l1", without=["arm_controller"])


def test_nodes_of_the_user_are_left_out_of_the_process():
    fused = settings(fused=True, without=["arm_controller"])
    inside = node_arguments.nodes_in(wiring.FLIGHT_CONTROLLER, fused)
    assert inside == tuple(name for name in wiring.FUSED if name != wiring.ARM)


def test_remappings_of_a_node_keep_to_that_node():
    given = {"mission": {"goal_pose": "planner/goal"}, "uam/markers": "shown"}
    words = node_arguments.process_remappings(
        settings(fused=True, remappings=given), wiring.FLIGHT_CONTROLLER
    )
    assert words == ["-r", "mission:goal_pose:=planner/goal", "-r", "uam/markers:=shown"]


@pytest.mark.parametrize(
    "given, text",
    [
        ({"fused": True, "engine": "direct"}, "--fused needs --engine ros"),
        ({"auto_start": False, "engine": "direct"}, "auto_start=False needs --engine ros"),
        ({"inner_rate": 50.0}, "--inner-rate needs --fused"),
        (
            {"fused": True, "inner_rate": 50.0, "without": ["arm_controller=mine"]},
            "--inner-rate needs every control node in the process",
        ),
        (
            {"parameters": {"flight_controller": {"inner_rate": 5.0}}},
            "only the fused layout has this node",
        ),
    ],
)
def test_options_that_need_the_layout_are_refused_without_it(given, text):
    with pytest.raises(SettingsError, match=text):
        settings(**given)


@pytest.mark.parametrize("clock, priority", [("realtime", 1), ("lockstep", None)])
def test_the_recorder_has_a_priority_where_nobody_waits_for_it(clock, priority, tmp_path):
    chosen = settings(fused=True, clock=clock, process={"fifo_priority": 50})
    sections = {wiring.FLIGHT_CONTROLLER: {}, wiring.RECORDER: {}}
    found = node_arguments.complete(sections, chosen, ResultFolder(tmp_path))
    assert found[wiring.FLIGHT_CONTROLLER]["fifo_priority"] == 50
    assert found[wiring.RECORDER].get("fifo_priority") == priority


def test_the_inner_rate_is_a_parameter_of_the_process():
    fused = settings(fused=True, inner_rate=50.0)
    assert fused.parameters == {"flight_controller": {"inner_rate": 50.0}}
