"""The person of a rehearsal: slow motions for each step of the list, and springs as hands."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.vehicle import load_description
from uam_sim_bridge.laboratory.person import MOTIONS, Grip, Person, eased, joint_torque, wrench

VEHICLE = load_description()


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_motion_goes_one_way_only(a, b):
    assert eased(0.0) == 0.0 and eased(1.0) == 1.0
    assert eased(min(a, b)) <= eased(max(a, b))


@pytest.mark.parametrize("step", MOTIONS)
def test_the_person_moves_slowly_and_comes_back(step):
    person, chi = Person(VEHICLE.joint_names, VEHICLE.stowed), np.zeros(8)
    time = 0.0
    while not person.wishes_to_confirm:  # the hands take it
        grip = person.update(time, "hands_on", chi)
        time += 0.02
    home = grip.pose.copy()
    assert home == pytest.approx([0.0, 0.0, 0.6, 0.0, 0.0, 0.0])
    poses = []
    while not person.wishes_to_confirm or person.done[-1] != step:
        poses.append(person.update(time, step, chi).pose.copy())
        time += 0.02
    poses = np.array(poses) - home
    for axis, value in MOTIONS[step]:
        far = poses[:, axis] / value
        assert far.max() == pytest.approx(1.0)
        assert np.sum(far > 0.999) * 0.02 >= 1.0  # held
    assert poses[-1] == pytest.approx(np.zeros(6), abs=1e-9)
    speed = np.abs(np.diff(poses, axis=0)) / 0.02
    assert speed[:, :3].max() < 0.7 and speed[:, 3:].max() < 1.0


def test_the_person_moves_one_joint_and_puts_the_vehicle_down():
    person, chi = Person(VEHICLE.joint_names, VEHICLE.stowed), np.zeros(8)
    chi[6:] = 0.1, 1.5
    time, seen = 0.0, []
    for step in ("hands_on", "joint:alpha_2", "clear"):
        while not person.done or person.done[-1] != step:
            grip = person.update(time, step, chi)
            time += 0.02
            if step == "joint:alpha_2" and grip.joints is not None:
                seen.append(grip.joints.copy())
    assert seen[0] == pytest.approx([0.1, 1.5], abs=1e-3)  # where it was, then folded
    assert np.max(seen, axis=0) == pytest.approx([0.1, math.pi / 2 + 0.3], abs=1e-3)
    assert grip.pose is None and grip.joints is None  # hands off
    assert person.done == ["hands_on", "joint:alpha_2", "clear"]
    assert person.update(time, "", chi).pose is None


def test_a_step_that_does_not_pass_is_done_again():
    person, chi, time = Person(VEHICLE.joint_names, VEHICLE.stowed), np.zeros(8), 0.0
    while len(person.done) < 3:
        person.update(time, "lift", chi)
        time += 0.02
        assert time < 60.0
    assert person.done == ["lift"] * 3


def test_hands_pull_towards_the_grip_and_carry_the_weight():
    state = np.zeros((3, 8))
    force, torque = wrench(Grip(np.array([0.1, 0.0, 0.0, 0.2, 0.0, 0.0])), state, 20.0)
    assert force == pytest.approx([40.0, 0.0, 20.0]) and torque[0] > 0.0
    assert torque[1:] == pytest.approx([0.0, 0.0])
    assert joint_torque(Grip(joints=np.array([0.1, -9.0])), state) == pytest.approx([0.4, -2.0])
    assert wrench(Grip(), state, 20.0)[0] == pytest.approx(np.zeros(3))
    assert joint_torque(Grip(), state) == pytest.approx(np.zeros(2))
