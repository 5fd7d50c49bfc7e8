"""Motions by hand: a correct vehicle always passes, a wrongly wired one never does."""

import math

import numpy as np
import pytest
from held_vehicle import HeldVehicle, Wiring, axis_vector, perform
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.maths.rotations import quaternion_from_rotation_vector
from uam_control.supervision import PreflightCheck
from uam_lab.flights.vehicle.checklist_parameters import ChecklistParameters
from uam_lab.preflight.checklist.checklist import Checklist
from uam_lab.preflight.checklist.guided import guided
from uam_lab.preflight.checklist.motion_step import MotionStep
from uam_lab.preflight.checklist.observation import Window
from uam_lab.preflight.checklist.step import Situation, StepState

LIMITS = ChecklistParameters()
JOINTS = ("alpha_1", "alpha_2")
TURNS = ("tilt_roll", "tilt_pitch", "yaw_turn")
SHIFTS = ("move_forward", "lift")
JOINT_STEPS = ("joint:alpha_1", "joint:alpha_2")
MOTIONS = (*TURNS, *SHIFTS, *JOINT_STEPS)
seeds = st.integers(0, 2**32 - 1)
FEW = settings(max_examples=8, deadline=None)


def steps():
    return {one.name: one for one in guided(JOINTS, LIMITS) if isinstance(one, MotionStep)}


def turned(axis, degrees):
    vector = np.zeros(3)
    vector["xyz".index(axis)] = math.radians(degrees)
    return quaternion_from_rotation_vector(vector)


def results(vehicle, names=MOTIONS):
    found = steps()
    return {name: perform(found[name], vehicle) for name in names}, found


def test_the_motions_are_those_of_the_list():
    assert tuple(steps()) == MOTIONS


@FEW
@given(seed=seeds, yaw=st.floats(-3.0, 3.0), keep=st.floats(0.8, 2.0))
def test_noise_and_biases_never_fail_a_correct_vehicle(seed, yaw, keep):
    vehicle = HeldVehicle(seed=seed, noise=1.0, yaw=yaw)
    for name, step in steps().items():
        assert perform(step, vehicle, keep) is StepState.PASSED, (name, step.value, step.seen)
        assert step.tries == 1


@FEW
@given(seed=seeds, name=st.sampled_from(TURNS))
def test_a_reversed_gyro_is_never_passed(seed, name):
    vehicle = HeldVehicle(Wiring(gyro=-1.0), seed, noise=1.0)
    step = steps()[name]
    assert perform(step, vehicle) is StepState.FAILED
    assert "gyro against mocap" in step.value


@FEW
@given(seed=seeds, name=st.sampled_from(TURNS), axis=st.integers(0, 2))
def test_a_reversed_command_is_never_passed(seed, name, axis):
    commands = np.eye(3)
    tested = TURNS.index(name)
    commands[tested, tested] = -1.0
    vehicle = HeldVehicle(Wiring(commands=commands), seed, noise=1.0)
    step = steps()[name]
    assert perform(step, vehicle) is StepState.FAILED
    assert step.value.startswith("commanded rate")


def test_commands_of_swapped_axes_are_not_passed():
    swapped = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    found, _ = results(HeldVehicle(Wiring(commands=swapped)), TURNS[:2])
    assert set(found.values()) == {StepState.FAILED}


def test_without_commands_the_mission_does_not_work():
    found, all_steps = results(HeldVehicle(Wiring(commands=np.zeros((3, 3)))), TURNS)
    assert set(found.values()) == {StepState.FAILED}
    assert "commanded rate: +0.00 rad/s" in all_steps["tilt_roll"].value.replace("-0.00", "+0.00")


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("degrees", [90, -90, 180])
def test_an_imu_that_is_mounted_turned_is_not_passed(axis, degrees):
    vehicle = HeldVehicle(Wiring(imu=turned(axis, degrees)))
    found, _ = results(vehicle, TURNS)
    assert StepState.FAILED in found.values() or StepState.ACTIVE in found.values()
    assert any(state is not StepState.PASSED for state in found.values())


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("degrees", [90, -90, 180])
def test_a_body_frame_of_motion_capture_that_is_turned_is_not_passed(axis, degrees):
    found, _ = results(HeldVehicle(Wiring(body=turned(axis, degrees))), (*TURNS, *SHIFTS))
    assert any(state is not StepState.PASSED for state in found.values())


def test_motive_with_y_up_is_not_passed():
    """Streamed without conversion: level looks level, the world is turned about x."""
    about_x = turned("x", -90)
    wiring = Wiring(world=about_x, body=about_x)
    found, all_steps = results(HeldVehicle(wiring), (*TURNS, *SHIFTS))
    assert found["yaw_turn"] is StepState.FAILED
    assert "swapped?" in all_steps["yaw_turn"].value
    assert found["lift"] is StepState.FAILED


def test_a_world_turned_about_the_vertical_is_a_correct_world():
    vehicle = HeldVehicle(Wiring(world=turned("z", 90)), noise=1.0)
    found, all_steps = results(vehicle)
    assert set(found.values()) == {StepState.PASSED}, [one.value for one in all_steps.values()]


@FEW
@given(seed=seeds)
def test_swapped_joints_are_never_passed(seed):
    vehicle = HeldVehicle(Wiring(joints=((1, 1), (0, 1))), seed, noise=1.0)
    found, all_steps = results(vehicle, JOINT_STEPS)
    assert set(found.values()) == {StepState.FAILED}
    assert "alpha_2 has moved in its place, swapped?" in all_steps["joint:alpha_1"].value


@FEW
@given(seed=seeds, reversed_joint=st.integers(0, 1))
def test_a_reversed_joint_is_never_passed(seed, reversed_joint):
    joints = tuple((i, -1 if i == reversed_joint else 1) for i in range(2))
    found, all_steps = results(HeldVehicle(Wiring(joints=joints), seed, noise=1.0), JOINT_STEPS)
    name = JOINT_STEPS[reversed_joint]
    assert found[name] is StepState.FAILED
    assert "the other direction, reversed?" in all_steps[name].value
    assert found[JOINT_STEPS[1 - reversed_joint]] is StepState.PASSED


def test_a_wrong_motion_of_the_person_fails_and_a_right_one_then_passes():
    vehicle, step = HeldVehicle(), steps()["tilt_roll"]
    step.begin(vehicle.time)
    vehicle.go(step, 1.2)
    vehicle.go(step, 1.0, turn=[-0.3, 0.0, 0.0])
    vehicle.go(step, 1.0)
    assert step.state is StepState.FAILED
    assert "reversed?" in step.value
    vehicle.go(step, 1.0, turn=np.zeros(3))
    vehicle.go(step, 2.0)
    for size in (0.3, -0.3, 0.0):
        vehicle.go(step, 1.0, turn=[size, 0.0, 0.0])
        vehicle.go(step, 1.0)
    assert step.state is StepState.PASSED
    assert step.tries == 2


def test_nothing_is_judged_while_it_moves_or_stays():
    vehicle, step = HeldVehicle(), steps()["yaw_turn"]
    step.begin(vehicle.time)
    vehicle.go(step, 5.0)
    assert step.state is StepState.ACTIVE
    vehicle.go(step, 0.4, turn=[0.0, 0.0, 0.5])
    vehicle.go(step, 0.3, turn=[0.0, 0.0, -0.2])
    assert step.state is StepState.ACTIVE


def test_a_motion_that_does_not_come_is_given_up():
    vehicle, step = HeldVehicle(), steps()["lift"]
    step.begin(vehicle.time)
    vehicle.go(step, LIMITS.step_time + 2.0)
    assert step.state is StepState.FAILED
    assert step.value == "not within 60 s: Lift the vehicle by 30 cm. Keep it there."


def test_a_tilted_vehicle_does_not_begin():
    vehicle, step = HeldVehicle(), steps()["tilt_roll"]
    vehicle.turn = np.array([0.0, 0.2, 0.0])
    step.begin(vehicle.time)
    vehicle.go(step, 2.0)
    assert step.instruction == "Hold the vehicle level and at rest."
    assert step.seen == "tilted by 0.20 rad, at most 0.12"


def test_samples_on_both_sides_of_a_gap_are_no_still_pose():
    vehicle, window = HeldVehicle(), Window(1.0)
    for _ in range(20):
        window.add(vehicle.sample())
    assert len(window.last(0.5)) == 13
    vehicle.time += 0.3
    window.add(vehicle.sample())
    assert window.last(0.5) == []
    vehicle.time += 0.6
    window.add(vehicle.sample())
    assert window.last(0.5) == []  # a single one is left
    for _ in range(12):
        window.add(vehicle.sample())
    assert len(window.last(0.5)) == 13


def test_without_samples_nothing_happens():
    step = steps()["lift"]
    step.begin(0.0)
    step.update(Situation(1.0))
    assert (step.state, step.seen) == (StepState.ACTIVE, "no samples of all sensors yet")


def test_the_whole_list_with_a_person():
    """All motions one after the other, with the checklist's own order and confirmations."""
    vehicle, checklist = HeldVehicle(noise=1.0), Checklist(guided(JOINTS, LIMITS))
    fine = (PreflightCheck("battery", "90 %", "", True),)

    def update(killed=False):
        sample = vehicle.sample()
        checklist.update(Situation(vehicle.time, sample, None, killed), fine, armed=False)

    class Watched:
        """A step, seen by the checklist."""

        def __init__(self, step):
            self.name, self._step = step.name, step

        state = property(lambda self: self._step.state)

        def begin(self, time):
            pass

        def update(self, now):
            checklist.update(now, fine, armed=False)

    done = []
    while not checklist.passed:
        update()
        step = checklist.step
        assert step is None or step.name not in done
        if isinstance(step, MotionStep):
            assert perform(Watched(step), vehicle) is StepState.PASSED
        elif step is not None and step.name == "kill_switch":
            for _ in range(20):
                update(killed=True)
            update(killed=False)
        elif step is not None:
            update()
            assert checklist.confirm()[0], step.name
        done += [] if step is None else [step.name]
    assert done == [one.name for one in checklist.steps]
    confirmed = [one.name for one in checklist.steps if one.confirmed]
    assert confirmed == ["hands_on", "magnet_on", "magnet_off", "clear"]


@FEW
@given(seed=seeds, name=st.sampled_from(TURNS))
def test_a_person_who_drifts_and_hesitates_does_not_fail_a_correct_vehicle(seed, name):
    """The gyro's bias must not add up over the time in which nothing happens."""
    vehicle, step = HeldVehicle(seed=seed, noise=1.0), steps()[name]
    step.begin(vehicle.time)
    vehicle.go(step, 0.8, turn=[0.0, 0.0, 0.04])  # slow enough to count as rest
    vehicle.go(step, 0.8, turn=np.zeros(3))
    vehicle.go(step, 25.0)
    axis = TURNS.index(name)
    for size in (0.3, -0.3) if axis < 2 else (0.5,):
        vehicle.go(step, 2.5, turn=axis_vector(axis, size))
        vehicle.go(step, 6.0)
    vehicle.go(step, 2.0, turn=np.zeros(3))
    vehicle.go(step, 1.0)
    assert step.state is StepState.PASSED, (step.value, step.seen)
