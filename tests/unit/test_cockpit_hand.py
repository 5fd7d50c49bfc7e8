"""The hand's marker: put at the hand, dragged, judged by the mission's limits, sent."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("viser")

from followed_reference import VEHICLE, P

from uam_lab.cockpit.hand_marker import HandMarker, Reach
from uam_lab.cockpit.vehicle_view import VehicleView
from uam_msgs_py.messages.tf_message import Transform
from uam_msgs_py.messages.topics import WORLD

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


class Screen:
    """viser's scene and panel, as far as the marker needs them."""

    def __init__(self):
        self.handles = {}
        self.gui = self.scene = self

    def _made(self, name, **look):
        handle = SimpleNamespace(content="", disabled=False, **{"position": None} | look)
        handle.on_click = lambda act: setattr(handle, "act", act)
        self.handles[name] = handle
        return handle

    def add_folder(self, name, **look):
        return nullcontext()

    def add_html(self, text):
        return self._made("text")

    def add_grid(self, name, **look):
        """Nothing to keep."""

    add_button = add_frame = add_transform_controls = add_icosphere = _made


def screen(sent):
    made = Screen()
    view = VehicleView(made)
    commands = SimpleNamespace(bring_hand=lambda place: sent.append(place.tolist()))
    return made, view, HandMarker(made, view, commands, VEHICLE, lambda act: act())


def shown(view, height):
    turned = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])  # yaw of 90 deg
    for parent, child, place, turn in (
        (WORLD, "base_link", (1.0, 2.0, height), turned),
        ("base_link", "magnet", (0.14, 0.0, -0.17), LEVEL),
        ("magnet", "end_effector", (0.0, 0.0, -0.03), LEVEL),
    ):
        view.transforms([Transform(0, parent, child, np.array(place), turn)])


def test_the_marker_begins_at_the_hand_and_says_what_can_be_reached():
    sent = []
    found, view, hand = screen(sent)
    found.handles["Marker at the hand"].act(None)
    assert "no hand is seen yet" in found.handles["text"].content
    hand.reach.know(vars(P))
    view.vehicle = np.array([0.0, 0.0, 0.28])
    shown(view, 0.28)
    hand.look()
    shown(view, 1.0)
    found.handles["Marker at the hand"].act(None)
    marker, go = found.handles["/world/hand_goal"], found.handles["Go with the hand"]
    np.testing.assert_allclose(marker.position, [1.0, 2.14, 0.8], atol=1e-12)
    hand.look()
    assert not go.disabled and "within reach" in found.handles["text"].content
    marker.position = (9.0, 0.0, 1.0)
    hand.look()
    assert go.disabled and "out of reach: the base would be at x" in found.handles["text"].content
    marker.position = (0.5, 0.0, 0.9)
    hand.look()
    assert not go.disabled
    go.act(None)
    assert sent == [[0.5, 0.0, 0.9]]


def test_without_limits_the_mission_decides():
    reach = Reach(VEHICLE)
    assert reach.refusal(np.array([99.0, 0.0, 1.0])) == ""
    reach.know(vars(P))
    reach.see(np.array([0.0, 0.0, 0.28]))
    reach.see(np.array([0.0, 0.0, np.nan]))
    assert "x = 98" in reach.refusal(np.array([99.0, 0.0, 1.0]))
    reach.know({"jog_hold": -1.0})  # no valid set: the old one stays
    assert "x = 98" in reach.refusal(np.array([99.0, 0.0, 1.0]))
