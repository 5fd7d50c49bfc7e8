"""The fused layout: its nodes, their order, its settings."""

import pytest

pytest.importorskip("rclpy")

from uam_control.stages.control_tick import STAGES
from uam_lab.flights import flight_settings
from uam_lab.flights.flight_settings import SettingsError
from uam_lab.flights.ros import node_arguments
from uam_lab.records.results.result_folder import ResultFolder
from uam_msgs_py.node import wiring
from uam_msgs_py.node.tick_times import NoTickTimes
from uam_sim_bridge.nodes import flight_controller


def test_every_stage_of_the_tick_has_its_node():
    assert list(flight_controller.ACTS) == [stage.name for stage in STAGES]
    acting = [act[0] for act in flight_controller.ACTS.values() if act]
    assert tuple(dict.fromkeys(acting)) == wiring.FUSED == tuple(flight_controller.KINDS)
    for act in filter(None, flight_controller.ACTS.values()):
        assert callable(getattr(flight_controller.KINDS[act[0]], act[1]))


class Acting:
    """A node that notes what it does."""

    def __init__(self, name, log):
        self.name, self.log, self.delivery, self.times = name, log, self, NoTickTimes()
        self.settle, self.begin_ticks, self.look_ahead, self.send_answers, self.send = (
            lambda act=act: log.append((name, act))
            for act in ("settle", "begin_ticks", "look_ahead", "send_answers", "send")
        )

    def get_name(self):
        return self.name


@pytest.mark.parametrize("absent", ["", *wiring.FUSED])
def test_a_pass_has_the_order_of_the_stages_and_sends_after_the_bridge(absent):
    log = []
    process = Acting("process", log)
    nodes = [Acting(name, log) for name in wiring.FUSED if name != absent]
    for step in flight_controller.steps([process, *nodes]):
        step()
    acts = [act for act in flight_controller.ACTS.values() if act]
    bridge = acts.index((wiring.BRIDGE, "settle"))
    expected = [*acts[: bridge + 1], ("process", "send_answers"), *acts[bridge + 1 :]]
    expected.append(("process", "send"))
    assert log == [(name, act) for name, act in expected if name != absent]


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
        ({"inner_rate": 50.0}, "--inner-rate needs --fused"),
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
