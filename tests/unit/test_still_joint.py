"""A joint whose reading stays the same while it must move, against hand-worked numbers."""

import math

import numpy as np
import pytest

from uam_control.arm.still_joint import stands, still_joints
from uam_control.supervision import Observation, Readings, SupervisionParameters
from uam_control.supervision.checks import Checks
from uam_control.supervision.monitor import Level


def seen(*rows, known=(0.0, 0.0)):
    """What `stands` says of each row: reading, reference [rad], torque [N m], largest 2.5 N m.

    known [N m]: parts of the torques of the first row, and of the others, for the known load.
    """
    memory, load = still_joints(1), [known[0], *[known[1]] * (len(rows) - 1)]
    return [stands(memory, 0, *row, one, 2.5, 1.0) for row, one in zip(rows, load, strict=True)]


# from 0.5 N m, friction holds up to 2 * .06 * 2.5 + .4 (.5 + |torque|) = .5 + .4 |torque|
@pytest.mark.parametrize(("row", "found"), [
    ((0.0, 0.04, -0.1), True),  # .6 of .54
    ((0.0, -0.04, 1.7), True),  # 1.2 of 1.18
    ((0.0, 0.04, 0.1), False),  # .4 of .54
    ((0.0, 0.04, 1.6), False),  # 1.1 of 1.14
    ((0.0, 0.03, -2.5), False),  # the reference is 1.7 degrees from the reading, 2 are needed
    ((4e-4, 0.04, -2.5), False),  # the reading moves
    ((0.0, 0.04, math.nan), False),  # unknown
])  # fmt: skip
def test_what_friction_cannot_hold_contradicts_a_reading_that_stays(row, found):
    assert seen((0.0, 0.0, 0.5), row) == [False, found]


# the torque changes by -.6 of .54; less what the known load changes by
@pytest.mark.parametrize(("load", "found"), [
    ((0.3, 0.3), True),
    ((0.3, 0.25), True),  # .55 remain
    ((0.3, 0.2), False),  # .5 remain: the other joints have moved
    ((0.3, 0.5), True),  # .8 remain, and .6 with the load as it was
    ((0.3, -0.4), False),  # the load explains more than the change
])  # fmt: skip
def test_a_torque_that_follows_its_known_load_contradicts_nothing(load, found):
    assert seen((0.0, 0.0, 0.5), (0.0, 0.04, -0.1), known=load) == [False, found]


def test_it_lasts_until_the_reading_changes_by_more_than_a_stuck_joint_creeps():
    rows = (
        (0.0, 0.0, 0.5),
        (0.0, 0.04, -0.1),
        (0.009, 0.0, 0.5),
        (0.011, 0.04, 0.5),
        (0.011, 0.1, 0.5),
    )
    assert seen(*rows) == [False, True, True, False, False]


def test_the_supervisor_holds_in_flight():
    limits = SupervisionParameters(
        joint_angle_hold=(2.0, 2.0), joint_effort_hold=(2.5, 2.5), hold_after=0.1
    )
    at, checks = np.zeros((3, 8)), Checks(limits)

    def update(stamp, wanted, torque, in_flight=True):
        reference = at.copy()
        reference[0, 7] = wanted
        readings = Readings(joint_effort=np.array([0.0, torque]))
        return checks.update(stamp, Observation(at, reference, readings=readings), in_flight)

    # .45 of .7 * (.3 + .4 * .55) = .364
    assert update(0.0, 0.0, 0.5, False) is update(0.1, 0.04, 0.05, False) is None
    assert update(0.2, 0.0, 0.5) is update(0.3, 0.04, 0.05) is None
    found = update(0.41, 0.04, 0.5)
    cause = "angle of a joint stays the same while its torque and its reference change"
    assert found.level is Level.HOLD and found.cause == cause
