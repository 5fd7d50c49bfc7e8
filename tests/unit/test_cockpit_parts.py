"""The cockpit's parts that need neither ROS graph nor browser."""

import math
import socket
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from hypothesis import given
from hypothesis import strategies as st
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from visualization_msgs.msg import Marker, MarkerArray

from uam_control.settings.parameter_set import Bound
from uam_control.supervision import PreflightCheck
from uam_lab.cockpit import page_address
from uam_lab.cockpit.gains import ParameterEntry, axes, bounds, reach, text_of, value_of
from uam_lab.cockpit.headline import ChecklistPanel, _facts, checklist_html, headline
from uam_lab.cockpit.page import BUTTONS
from uam_lab.cockpit.vehicle_health import BAD, CAUTION, CHAIN, GOOD, TICK, UNKNOWN, Health, grade
from uam_lab.cockpit.vehicle_view import MOST_FRAMES, VehicleView, shapes
from uam_msgs_py.messages.checklist import checklist_message
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.status import (
    ERROR,
    OK,
    AutopilotState,
    ChecklistState,
    MissionStatus,
    diagnostic,
)
from uam_msgs_py.messages.tf_message import Transform, read_transforms, transforms_message
from uam_msgs_py.messages.topics import WORLD
from uam_msgs_py.node.node_parameters import descriptor
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.urdf import BASE_LINK, urdf

LIMITS = {
    "position_error": [0.05, 0.2],
    "attitude_error": [0.05, 0.2],
    "arm_error": [0.05, 0.2],
    "battery": [0.3, 0.15],
}
numbers = st.floats(-1e6, 1e6)


def about(constraints: str, low=None, high=None) -> ParameterDescriptor:
    span = [] if low is None else [FloatingPointRange(from_value=low, to_value=high)]
    described = {"additional_constraints": constraints, "floating_point_range": span}
    return ParameterDescriptor(name="gain", description="a gain [1/s]", **described)


@given(st.one_of(numbers, st.lists(numbers, min_size=1, max_size=4), st.booleans()))
def test_what_is_typed_is_what_was_shown(value):
    read = value_of(text_of(value), value)
    assert type(read) is type(value)
    assert np.allclose(read, value, rtol=1e-5)


@pytest.mark.parametrize(
    ("text", "like"), [("1, two, 3", [1.0] * 3), ("", 1.0), ("yes", True), ("1,,3", [1.0] * 3)]
)
def test_what_cannot_be_read_is_refused(text, like):
    with pytest.raises(ValueError, match="expected"):
        value_of(text, like)


class Widgets:
    """viser's panel, as far as an entry needs it."""

    def _made(self, *given, **look):
        handle = SimpleNamespace(value=given[-1] if given else "", step=given[3:4], **look)
        handle.on_update = handle.on_submit = lambda act: None
        return handle

    def add_folder(self, label, **look):
        return nullcontext(self._made())

    add_form = add_folder
    add_html = add_text = add_slider = _made


def test_a_whole_number_stays_one():
    asked, spec = [], Bound("approaches", "", 1, 20, whole=True)
    remote = SimpleNamespace(known={"n": descriptor(spec, False)}, values={"n": 3}, node="mission")
    remote.set = lambda changes, answer: asked.append(changes["n"])
    entry = ParameterEntry(Widgets(), "n", remote, lambda act: act(), lambda done, text: None)
    for typed in ("4", "2.5"):
        entry._ask_for(typed)
    assert [repr(one) for one in asked] == ["4", "2.5"]  # the node refuses the second
    assert reach(remote.known["n"], 3.0)[2] == 1.0


@given(st.floats(0.0, 1e3), st.floats(0.0, 1e3), st.floats(0.0, 1.0))
def test_a_slider_stays_within_the_range_and_holds_the_value(low, width, share):
    high = low + width
    value = min(high, low + share * width)
    least, most, step = reach(about("", low, high), value)
    assert low <= least <= value <= most <= high
    assert step > 0.0


def test_the_range_of_a_vectors_entries_is_that_of_its_node():
    reported = about("each 1e-09 to 1e+06 1/s^2; x, y, z")
    assert bounds(reported) == bounds(about("each 1e-09 to 1e+06; x, y, z")) == (1e-9, 1e6)
    assert list(axes(reported, 3)) == ["x", "y", "z"]
    assert list(axes(reported, 2)) == ["0", "1"]
    assert bounds(about("")) == (-math.inf, math.inf)


def test_grades():
    assert [grade(v, 0.05, 0.2) for v in (0.01, 0.05, 0.2, math.nan)] == [
        GOOD,
        CAUTION,
        BAD,
        UNKNOWN,
    ]
    assert [grade(v, 0.3, 0.15) for v in (0.9, 0.3, 0.1)] == [GOOD, CAUTION, BAD]


def reported(name: str, level: bytes, summary: str, **values) -> DiagnosticArray:
    return diagnostic(0, name, level, summary, values)


def test_the_headline_shows_the_state():
    health = Health(silent_after=3.0)
    assert "WAITING FOR A FLIGHT" in headline(health, LIMITS)
    health.silence = 0.1
    health.set_mission(MissionStatus("approach", 12.0, 0.004, 0.1, 0.3))
    health.autopilot = AutopilotState(True, "OFFBOARD", True, 0, "")
    health.diagnose(reported("arm_controller", OK, "running", saturated=True))
    page = headline(health, LIMITS)
    assert health.state() == (GOOD, "approach", "")
    for part in ("APPROACH", "T +12.0 s", ">0.4<", "OFFBOARD, armed", "all 1 healthy", "saturated"):
        assert part in page, part
    health.diagnose(reported("arm_controller", ERROR, "<b>no</b> joints", saturated=False))
    page = headline(health, LIMITS)
    assert "&lt;b&gt;no&lt;/b&gt; joints" in page
    assert "<b>no" not in page
    assert "saturated" not in page
    for status, message in (
        (
            MissionStatus("hold", state="blind", cause="no pose"),
            (CAUTION, "blind", "no pose"),
        ),
        (
            MissionStatus("hold", state="holding", cause="by command"),
            (CAUTION, "holding", "by command"),
        ),
        (
            MissionStatus("land", abort_reason="battery", state="landing", cause="battery"),
            (BAD, "land", "battery"),
        ),
        (
            MissionStatus("aborted", abort_reason="tilt", state="failsafe", cause="tilt"),
            (BAD, "failsafe", "tilt"),
        ),
    ):
        health.set_mission(status)
        assert health.state() == message
        assert message[1].upper() in headline(health, LIMITS)
        assert message[2] in headline(health, LIMITS)
    health.silence = 7.0
    health.set_mission(MissionStatus("approach", 12.0))
    assert health.state() == (BAD, "no signal for 7 s", "")
    health.set_mission(MissionStatus("landed", 90.0, done=True))
    assert health.state() == (GOOD, "flight over", "")
    health.set_mission(MissionStatus("aborted", 90.0, abort_reason="tilt 90 deg", done=True))
    assert health.state() == (BAD, "flight over", "tilt 90 deg")


def test_errors_come_from_tracking_once_it_is_there():
    health = Health(silent_after=3.0)
    health.set_mission(MissionStatus("approach", 1.0, 0.5, 0.5, 0.5))
    assert health.errors == (0.5, 0.5, 0.5)
    health.track(np.array([0.3, 0.4, 0.0, 0.1, 0.0, 0.0, 0.0, 0.2]))
    health.set_mission(MissionStatus("approach", 1.5, 0.9, 0.9, 0.9))
    assert health.errors == pytest.approx((0.5, 0.1, 0.2))


def shown(health: Health) -> str:
    return headline(health, LIMITS)


def test_the_headline_names_who_has_control_and_the_tilt():
    health = Health(silent_after=3.0, silence=0.1)
    health.set_mission(MissionStatus("carry", 12.0, attitude_error=0.01, tilt=0.09))
    health.autopilot = AutopilotState(True, "OFFBOARD", True, 0, "")
    assert "companion" in shown(health) and "5.2°" in shown(health) and ">0.6<" in shown(health)
    health.autopilot = AutopilotState(True, "POSCTL", True, 0, released_to="POSCTL, by the pilot")
    assert "POSCTL, by the pilot, has control" in shown(health)
    health.set_mission(MissionStatus("released", 13.0, state="released", cause="POSCTL"))
    assert health.state() == (CAUTION, "released", "POSCTL")


def test_the_pre_arm_report_is_shown_on_the_ground():
    health = Health(silent_after=3.0)
    health.preflight = [
        PreflightCheck("battery", "0.9", "at least 0.3", True),
        PreflightCheck("mocap", "unknown", "at most 0.2 s", False),
    ]
    health.set_mission(MissionStatus())
    assert "battery" in shown(health) and "unknown (at most 0.2 s)" in shown(health)
    assert shown(health).count("■") == 1
    health.set_mission(MissionStatus("carry", 3.0))
    assert "pre-arm" not in shown(health)


def test_the_delays_are_shown_with_their_limits():
    health = Health(silent_after=3.0, period=0.004)
    health.set_mission(MissionStatus("carry", 3.0, setpoint_delay=0.0212, delay_margin=0.03))
    health.autopilot = AutopilotState(True, "OFFBOARD", True, 0, round_trip=0.0241)
    assert "24.1 ms there and back" in shown(health) and "per tick" not in shown(health)
    assert "21.2 of 30 ms margin" in shown(health)
    facts = {name: level for name, level, _ in _facts(health, LIMITS)}
    assert facts["setpoint delay"] == CAUTION
    health.delay_shares = (0.1, 0.7)
    assert {name: level for name, level, _ in _facts(health, LIMITS)}["setpoint delay"] == BAD
    for node in CHAIN:
        health.diagnose(reported(node, OK, "running", **{"tick max [ms]": "0.45"}))
    assert health.latency == pytest.approx(0.0018) and "1.8 of 4 ms per tick" in shown(health)


def test_kill_is_guarded_and_called_twice():
    kill = next(button for button in BUTTONS if button.label == "Kill")
    assert kill.ask and kill.calls == 2
    labels = [button.label for button in BUTTONS[:6]]
    assert labels == ["Start", "Hold", "Resume", "Land", "Disarm", "Kill"]


def test_a_node_without_diagnostics_is_reported():
    health = Health(silent_after=0.0)
    health.diagnose(reported("mission", OK, "running"))
    ((name, level, words),) = health.ailing()
    assert (name, level) == ("mission", BAD)
    assert words.startswith("silent")


def test_the_robot_has_the_shapes_of_its_urdf():
    found = shapes(urdf(Vehicle.load("s500_arm")))
    assert {shape.kind for shape in found} <= {"box", "cylinder", "sphere"}
    assert {BASE_LINK, "link_1", "link_2", "magnet"} <= {shape.link for shape in found}
    assert all(np.all(shape.size > 0.0) for shape in found)
    assert all(abs(np.linalg.norm(shape.quaternion) - 1.0) < 1e-9 for shape in found)
    assert shapes("no URDF") == []
    assert (
        shapes(
            '<robot><link name="a"><visual><geometry><box size="x"/></geometry>'
            "</visual></link></robot>"
        )
        == []
    )


frames = st.builds(
    Transform,
    st.integers(0, 2**31 * 10**9 - 1),
    st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9),
    st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9),
    st.lists(numbers, min_size=3, max_size=3).map(np.array),
    st.lists(numbers, min_size=4, max_size=4).map(np.array),
)


@given(st.lists(frames, max_size=4))
def test_transforms_are_read_as_they_were_written(sent):
    read = read_transforms(transforms_message(sent))
    assert len(read) == len(sent)
    for one, other in zip(read, sent, strict=True):
        assert (one.stamp, one.parent, one.child) == (other.stamp, other.parent, other.child)
        assert np.array_equal(one.position, other.position)
        assert np.array_equal(one.quaternion, other.quaternion)


@given(st.binary(max_size=120))
def test_what_is_no_list_of_transforms_is_refused_or_read(data):
    try:
        read_transforms(data)
    except BadMessage:
        pass


def test_the_next_port_is_taken_where_one_is_in_use():
    with socket.create_server((page_address.LOCAL, 0)) as taken:
        port = taken.getsockname()[1]
        assert page_address.free_port(page_address.LOCAL, port) > port
        # in steps, the ports of two flights never meet
        assert (page_address.free_port(page_address.LOCAL, port, 40) - port) % 40 == 0
    with pytest.raises(page_address.AddressError, match="cannot serve on 203.0.113.7"):
        page_address.free_port("203.0.113.7", 8080)


def test_the_checklist_shows_the_step_and_what_is_open():
    items = [
        PreflightCheck("battery", "90 %", "at least 60 %", True, kind="automatic"),
        PreflightCheck("radio", "<not> received", "received", False, kind="automatic"),
        PreflightCheck("lift", "", "up at least 0.2 m", None, kind="guided"),
    ]
    state = ChecklistState(False, "radio; lift", "lift", "motion", "Lift it.", "up +0.10 m")
    shown = checklist_html(state, items)
    assert 'data-step="lift"' in shown and "Lift it." in shown and "up +0.10 m" in shown
    assert "&lt;not&gt; received" in shown and "battery" not in shown
    assert "1 of 3 items have passed" in shown
    assert "All items have passed." in checklist_html(ChecklistState(True), items[:1])


class Clicked:
    """Stands for viser's gui: stores what was added."""

    def __init__(self):
        self.content, self.disabled, self.acts, self.added = "", False, [], {}

    def add_folder(self, label, order):
        return nullcontext()

    def add_html(self, content):
        return self.added.setdefault("html", Clicked())

    def add_button(self, label, icon):
        return self.added.setdefault(label, Clicked())

    def on_click(self, act):
        self.acts.append(act)


def test_the_buttons_of_the_checklist_call_its_services():
    gui, called, said = Clicked(), [], []

    def call(kind, name, request, answer):
        called.append(name)
        answer(None, f"{name}: no response")

    services = SimpleNamespace(call=call)
    panel = ChecklistPanel(gui, services, lambda act: act(), lambda *line: said.append(line))
    assert not gui.added  # no checklist, no panel
    for needs, disabled in (("motion", True), ("confirm", False)):
        state = ChecklistState(False, "lift", "lift", needs)
        panel.show(checklist_message(0, state, []))
        assert gui.added["Confirm"].disabled is disabled
        assert not gui.added["Repeat the step"].disabled
    for label in ("Confirm", "Repeat the step"):
        gui.added[label].acts[0](None)
    assert called == ["checklist/confirm", "checklist/repeat"]
    assert said[0] == (False, "checklist: checklist/confirm: no response")


class Scene:
    """viser's scene, as far as frames need it."""

    def __init__(self):
        self.frames = {}

    def add_grid(self, name, **look):
        """Nothing to keep."""

    def add_frame(self, name, **look):
        return self.frames.setdefault(name, SimpleNamespace(position=None, wxyz=None))


def test_frames_without_end_do_not_fill_the_page():
    scene = Scene()
    view = VehicleView(scene)
    level = np.array([1.0, 0.0, 0.0, 0.0])

    def frame(number, x=0.0):
        return Transform(0, WORLD, f"f{number}", np.array([x, 0.0, 0.0]), level)

    view.transforms([frame(number) for number in range(MOST_FRAMES)])
    with pytest.raises(BadMessage, match="200 frames"):
        view.transforms([frame(MOST_FRAMES)])
    view.transforms([frame(0, x=3.0)])
    assert len(scene.frames) == MOST_FRAMES
    assert scene.frames["/world/f0"].position[0] == 3.0


def test_loops_orphans_and_a_moved_world_leave_the_vehicle_in_the_scene():
    scene, level = Scene(), np.array([1.0, 0.0, 0.0, 0.0])
    view = VehicleView(scene)
    hostile = [("a", "b"), ("b", "a"), ("c", "c"), ("", ""), ("a", WORLD), (WORLD, WORLD)]
    hostile += [(f"nowhere{i}", f"orphan{i}") for i in range(2 * MOST_FRAMES)]
    view.transforms([Transform(0, p, c, np.zeros(3), level) for p, c in hostile])
    deep = [
        (WORLD, "base_link"),
        *((f"d{i}" if i else "base_link", f"d{i + 1}") for i in range(50)),
    ]
    for x in (1.0, math.nan, math.inf, 2.0):
        view.transforms([Transform(0, p, c, np.array([x, 0, 0]), level) for p, c in deep])
    assert scene.frames["/world/base_link"].position[0] == 2.0
    assert len(scene.frames) == 51


def test_a_marker_with_a_number_that_is_not_finite_is_refused():
    marker = Marker(ns="payload", type=Marker.CUBE)
    marker.header.frame_id, marker.color.r = WORLD, math.inf
    with pytest.raises(BadMessage, match="marker payload: a number is not finite"):
        VehicleView(Scene()).markers(MarkerArray(markers=[marker]))


def test_a_value_of_diagnostics_that_is_no_number_is_left_out():
    values = [KeyValue(key=TICK, value=text) for text in ("1.5", "abc", "nan", "1e999", "")]
    status = DiagnosticStatus(name="mission", level=OK, values=values)
    health = Health(5.0)
    health.diagnose(DiagnosticArray(status=[status]))
    assert health.ticks == {"mission": 1.5e-3}
