"""The errors of the mission's status: joined by stamp, the attitude against the law's."""

import math

import numpy as np
import pytest

from uam_control.maths.rotations import tilt
from uam_control.nodes.mission_errors import DELAY, STORED, Errors, TrackingErrors
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import PositionCommandWriter
from uam_msgs_py.messages.layouts import BadMessage

SIZE, PERIOD = 8, 4_000_000


class Listener:
    """Stands in for the node: keeps the handler of the topic."""

    def listen(self, topic, handle, required):
        assert topic is topics.POSITION_COMMAND and not required
        self.handle = handle


@pytest.fixture
def rig():
    node = Listener()
    return node, TrackingErrors(node), PositionCommandWriter()


def state(x=0.0, roll=0.0, alpha=0.0):
    values = np.zeros((3, SIZE))
    values[0, [0, 3, 6]] = x, roll, alpha
    return values


def fly(rig, ticks, flying=True, commands=True):
    """Tick k: x = k cm, roll 0.1 k; the law desires a roll of 0.1 k - 0.02 in its command."""
    node, errors, writer = rig
    for k in range(1, ticks + 1):
        errors.tick(k * PERIOD, state(0.01 * k, 0.1 * k, 0.5), state(), flying)
        if commands:
            desired = np.array([[0.1 * k - 0.02, 0.0, 0.0], [0.0] * 3, [0.0] * 3])
            node.handle(writer.fill(k * PERIOD, state(), desired, np.zeros(3)))
    return errors.newest()


def test_errors_are_of_one_tick_and_the_attitudes_is_from_the_desired_one(rig):
    found = fly(rig, 6)
    k = 6 - DELAY
    assert found == pytest.approx(Errors(0.01 * k, 0.02, 0.5, 0.1 * k))


def test_before_enough_ticks_the_oldest_counts(rig):
    assert rig[1].newest() == Errors()
    assert fly(rig, 1).attitude == pytest.approx(0.02)


def test_a_late_command_changes_nothing(rig):
    """In lockstep the command of the newest tick arrives before the status or after it."""
    node, errors, writer = rig
    before = fly(rig, 6)
    level = np.zeros((3, 3))
    node.handle(writer.fill(7 * PERIOD, state(), level, np.zeros(3)))
    assert errors.newest() == before


def test_on_the_ground_only_the_arm_is_controlled(rig):
    assert fly(rig, 4, flying=False) == pytest.approx(Errors(0.0, 0.0, 0.5, 0.2))


def test_without_its_command_a_tick_has_no_attitude_error(rig):
    assert fly(rig, 2 * STORED, commands=False).attitude == 0.0


def test_a_message_that_is_none_is_refused_at_the_door_or_later_ignored(rig):
    node, errors, writer = rig
    with pytest.raises(BadMessage):
        node.handle(b"\0\1")
    message = bytes(writer.fill(PERIOD, state(), np.ones((3, 3)), np.zeros(3)))
    errors.tick(PERIOD, state(), state(), True)
    node.handle(message[: len(message) // 2])
    assert errors.newest().attitude == 0.0


@pytest.mark.parametrize(
    ("euler", "angle"),
    [((0, 0, 2), 0.0), ((0.3, 0, 1), 0.3), ((0, -0.4, 0), 0.4), ((math.pi, 0, 0), math.pi)],
)
def test_tilt(euler, angle):
    assert tilt(np.array(euler, dtype=float)) == pytest.approx(angle)
