"""A gamepad's axes and buttons, and keys in their place; the dead-man button."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from uam_control.stages.gamepad import Gamepad, Keys, Mapping, MappingError

SHIPPED = Path(__file__).resolve().parents[2] / "config/teleop/gamepad.yaml"
PAD = Mapping.read("gamepad")
LIMITS = 0.1, 0.2


def buttons(*pressed):
    return [int(number in pressed) for number in range(8)]


def axes(**values):
    found = [0.0] * 8
    for name, value in values.items():
        found[int(name[1:])] = value
    return found


def test_axes_are_velocities_while_the_dead_man_button_is_held():
    pad = Gamepad(PAD)
    pad.read(axes(a1=0.5, a0=-1.0, a3=1.0), buttons())
    assert pad.twist(LIMITS) is None
    pad.read(axes(a1=0.5, a0=-7.0, a4=0.05, a3=1.0), buttons(4))  # beyond -1: -1; in the dead zone
    np.testing.assert_allclose(pad.twist(LIMITS), [0.05, -0.1, 0.0, 0.0, 0.0, 0.2])
    np.testing.assert_allclose(pad.twist(LIMITS), [0.05, -0.1, 0.0, 0.0, 0.0, 0.2])
    pad.read(axes(a1=0.5), buttons())
    np.testing.assert_array_equal(pad.twist(LIMITS), np.zeros(6))  # once
    assert pad.twist(LIMITS) is None


def test_the_end_of_an_axis_is_a_share_of_the_limits(tmp_path):
    values = yaml.safe_load(SHIPPED.read_text())
    values |= {"linear": {"x": {"axis": 1, "share": -0.5}}, "angular": {"z": {"axis": 3}}}
    file = tmp_path / "pad.yaml"
    file.write_text(yaml.safe_dump(values))
    pad = Gamepad(Mapping.read(str(file)))
    pad.read(axes(a1=1.0, a3=0.5), buttons(4))
    np.testing.assert_allclose(pad.twist((0.0175, 0.06)), [-0.00875, 0.0, 0.0, 0.0, 0.0, 0.03])


def test_silence_ends_the_motion():
    pad = Gamepad(PAD)
    pad.read(axes(a1=1.0), buttons(4))
    assert pad.twist(LIMITS).any()
    pad.silence()
    assert not pad.twist(LIMITS).any() and pad.twist(LIMITS) is None


def test_a_button_acts_once_and_the_gripper_needs_the_dead_man():
    pad = Gamepad(PAD)
    assert pad.read(axes(), buttons(1)) == (True, None)
    assert pad.read(axes(), buttons(1)) == (False, None)
    assert pad.read(axes(), buttons(0)) == (False, None)
    assert pad.read(axes(), buttons()) == (False, None)
    assert pad.read(axes(), buttons(0, 4)) == (False, 1.0)
    assert pad.read(axes(), buttons(0, 4)) == (False, None)
    assert pad.read(axes(), buttons(2, 4)) == (False, 0.0)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (([0.0] * 2, buttons(4)), "2 axes and 8 buttons, the mapping needs 8 and 5"),
        ((axes(), [0, 0]), "8 axes and 2 buttons"),
        ((axes(a1=math.nan), buttons(4)), "an axis is not finite"),
    ],
)
def test_bad_messages_stop_the_motion(given, text):
    pad = Gamepad(PAD)
    pad.read(axes(a1=1.0), buttons(4))
    assert pad.twist(LIMITS).any()
    with pytest.raises(ValueError, match=text):
        pad.read(*given)
    assert not pad.twist(LIMITS).any()


def test_keys_count_as_held_for_a_while():
    pad, keys = Gamepad(PAD), Keys(PAD)
    assert keys.press("w", 1.0) and keys.press("q", 1.2) and not keys.press("!", 1.0)
    for now, expected in ((1.25, [0.1, 0, 0, 0, 0, 0.2]), (1.35, [0, 0, 0, 0, 0, 0.2])):
        pad.read(*keys.state(now))
        np.testing.assert_allclose(pad.twist(LIMITS), expected)
    pad.read(*keys.state(1.6))
    assert not pad.twist(LIMITS).any()
    for key, value in (("w", 0.1), ("s", -0.1), ("w", 0.1)):
        keys.press(key, 1.9)
        pad.read(*keys.state(1.95))
        assert pad.twist(LIMITS)[0] == pytest.approx(value)
    keys.press("h", 2.0)
    assert pad.read(*keys.state(2.1)) == (True, None)


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("frame", "base", "frame: .*world, end_effector"),
        ("dead_man", -1, "dead_man: "),
        ("rate", 0.0, "rate: "),
        ("linear", {"u": {"axis": 1}}, "u"),
        ("linear", {"x": {"axis": 1, "share": -1.5}}, "share: -1.5 is not within"),
        ("keys", {"w": {"axis": 1, "speed": 2.0}}, "speed"),
        ("colour", "red", "colour"),
    ],
)
def test_a_mapping_is_checked(tmp_path, key, value, text):
    values = yaml.safe_load(SHIPPED.read_text()) | {key: value}
    file = tmp_path / "pad.yaml"
    file.write_text(yaml.safe_dump(values))
    with pytest.raises(MappingError, match=text):
        Mapping.read(str(file))
    with pytest.raises(MappingError, match="gamepad"):
        Mapping.read("none")
