"""Stop, resume and descent: smooth and within limits, from any start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from uam_control.mission import MissionParameters, load_scenario
from uam_control.mission.guidance import Guidance
from uam_control.mission.motion.path_clock import PathClock
from uam_control.mission.motion.segments import Segment
from uam_control.mission.motion.trajectory import empty_motion
from uam_control.mission.payload_watch import PayloadWatch, Shift

START = np.array([0.0, 0.0, 0.28, 0.0, 0.0, 0.0, 0.0, np.pi / 2])
DT = 0.01
NO_SHRINKING = (Phase.explicit, Phase.reuse, Phase.generate)  # flights are long


def guidance(**parameters):
    scenario = load_scenario("pick_and_place")
    made = MissionParameters(**parameters)
    return Guidance(scenario.trajectory(START), 100.0, np.zeros((3, 8)), scenario.arm_start, made)


def fly(guide, begin, end, at=()):
    """Return references (n, 3, 8) from `begin` to `end` [s]; at: (time, function of the stamp)."""
    found, due = [], sorted(at, key=lambda item: item[0])
    for k in range(round(begin / DT), round(end / DT)):
        stamp = 100.0 + k * DT
        guide.advance(stamp)
        guide.write(stamp)
        while due and stamp >= 100.0 + due[0][0]:
            due.pop(0)[1](stamp)
        found.append(guide.motion[:3].copy())
    return np.array(found)


def assert_smooth(references):
    """Check that rows are derivatives of each other, continuous, and bounded: vehicle, joints."""
    assert np.all(np.isfinite(references))
    middle = references[1:-1]
    np.testing.assert_allclose(
        (references[2:, 0] - references[:-2, 0]) / (2 * DT), middle[:, 1], atol=3e-3
    )
    np.testing.assert_allclose(
        (references[2:, 1] - references[:-2, 1]) / (2 * DT), middle[:, 2], atol=0.12
    )
    for part, rate, acceleration in ((slice(0, 6), 0.8, 1.2), (slice(6, 8), 1.0, 3.0)):
        assert np.max(np.abs(middle[:, 1, part])) < rate
        assert np.max(np.abs(middle[:, 2, part])) < acceleration


def test_an_arm_that_gives_way_stays_where_it_was_pushed_and_returns_smoothly():
    guide, pushed = guidance(), np.array([0.3, 1.2])
    fly(guide, 0.0, 3.0, [(1.0, lambda stamp: guide.stop(stamp, stow=False))])
    base = guide.motion[:, :6].copy()
    for _ in range(3):
        guide.write(103.0)
        guide.give_way(103.0, pushed)
        assert np.array_equal(guide.reference[0, 6:], pushed) and not guide.reference[1:, 6:].any()
        guide.give_way(103.0, np.array([np.nan, 0.0]))  # no change
    assert np.array_equal(guide.motion[:, :6], base)
    after = fly(guide, 3.0, 12.0, [(4.0, guide.go_on)])
    assert np.array_equal(after[50, 0, 6:], pushed)
    assert_smooth(after)


def test_undisturbed_it_is_the_trajectory_itself_bit_for_bit():
    guide, expected = guidance(), empty_motion(2)
    trajectory = load_scenario("pick_and_place").trajectory(START)
    for k in range(0, 8800, 17):
        stamp = 100.0 + k * DT
        guide.advance(stamp)
        guide.write(stamp)
        trajectory.write(stamp - 100.0, expected)
        np.testing.assert_array_equal(guide.motion, expected)


@settings(deadline=None, max_examples=20, phases=NO_SHRINKING)
@given(st.floats(0.5, 80.0), st.floats(0.1, 6.0), st.floats(0.1, 4.0), st.booleans())
@example(66.98373119957263, 1.875, 1.7713514926379688, True)  # back while the arm moves away
def test_hold_and_resume_are_smooth_at_any_time(at, held, again, stow):
    guide = guidance()
    references = fly(guide, at - 0.1, at + held + again + 14.0, [
        (at, lambda stamp: guide.stop(stamp, stow)),
        (at + held, guide.go_on),
        (at + held + again, lambda stamp: guide.stop(stamp, False)),
    ])  # fmt: skip
    assert_smooth(references)
    np.testing.assert_allclose(references[-1, 1:], 0.0, atol=1e-12)


def test_after_a_hold_with_stowed_arm_the_scenario_continues_with_a_delay():
    guide = guidance()
    references = fly(guide, 15.0, 45.0, [
        (20.0, lambda stamp: guide.stop(stamp, True)), (30.0, guide.go_on)])  # fmt: skip
    assert_smooth(references)
    held = references[round((29.0 - 15.0) / DT), 0]
    assert held[6:] == pytest.approx(START[6:])
    expected = empty_motion(2)
    load_scenario("pick_and_place").trajectory(START).write(guide.scenario_time, expected)
    np.testing.assert_allclose(references[-1], expected[:3], atol=1e-9)
    assert 9.0 < 45.0 - guide.scenario_time < 14.0


@settings(deadline=None, max_examples=20, phases=NO_SHRINKING)
@given(
    st.floats(0.5, 80.0),
    st.floats(-1.5, 1.5),
    st.floats(-1.5, 1.5),
    st.sampled_from([0.0, np.nan, np.inf]),
    st.booleans(),
)
def test_a_descent_is_smooth_from_anywhere_and_ends_below_the_vehicle(at, dx, dy, strange, stow):
    guide, state = guidance(), np.zeros((3, 8))

    def descend(stamp):
        state[0, :3] = guide.reference[0, :3] + [dx, dy, strange]
        guide.descend(stamp, state, START[2], stow)

    references = fly(guide, at - 0.1, at + 20.0, [(at, descend)])
    assert_smooth(references)
    end = references[-1]
    np.testing.assert_array_equal(end[1:], 0.0)
    assert end[0, 2] == pytest.approx(START[2] - 0.03)
    before = references[10, 0]
    moved = end[0, :2] - before[:2] - ([dx, dy] if strange == 0.0 else [0.0, 0.0])
    assert np.max(np.abs(moved)) < 0.15
    if stow:
        assert end[0, 6:] == pytest.approx(START[6:])


@given(st.lists(st.tuples(st.floats(0.01, 3.0), st.sampled_from([0.0, 1.0])), max_size=6))
def test_a_clock_never_jumps_for_any_changes(changes):
    clock, stamp = PathClock(0.0), 1.0
    before = clock.at(stamp)
    for wait, goal in changes:
        clock.change(stamp, goal, 1.0)
        assert clock.at(stamp)[:3] == pytest.approx(before[:3], abs=1e-9)
        stamp += wait
        before = clock.at(stamp)
        later = clock.at(stamp + 1e-6)
        assert (later[0] - before[0]) / 1e-6 == pytest.approx(before[1], abs=1e-3)
        assert (later[1] - before[1]) / 1e-6 == pytest.approx(before[2], abs=1e-3)
    assert clock.at(stamp + 5.0)[1] in (0.0, 1.0)


def test_a_segment_takes_its_own_time_for_each_coordinate():
    start, goal = np.zeros((3, 8)), np.arange(8.0)
    segment = Segment(5.0, start, goal, np.arange(1.0, 9.0))
    motion = empty_motion(2)
    segment.write(7.0, motion)
    np.testing.assert_array_equal(motion[0, :2], goal[:2])
    assert motion[0, 3] == pytest.approx(1.5) and segment.end == 13.0


def test_without_a_controller_the_reference_has_the_vehicles_motion_and_returns_smoothly():
    guide = guidance()
    state = np.zeros((3, 8))

    def adrift(stamp):
        path = guide.reference[0].copy()
        state[0] = (-0.6, 0.2, 0.9, 0.1, 0.1, 0.1, *path[6:])
        guide.stay(stamp, state, START[2])
        np.testing.assert_allclose(guide.reference[0, [0, 1, 2, 5]], state[0, [0, 1, 2, 5]])
        np.testing.assert_array_equal(guide.reference[0, 6:], path[6:])

    fly(guide, 0.0, 10.0, [(9.0, lambda stamp: guide.stop(stamp, False))])
    fly(guide, 10.0, 13.0, [(12.0 + 0.1 * k, adrift) for k in range(10)])
    guide.go_on(113.0)
    back = fly(guide, 13.0, 25.0)
    assert back[0, 0, 0] == pytest.approx(-0.6, abs=0.01), "from where it was"
    assert np.max(np.abs(np.diff(back[:, 1, :6], axis=0))) < 0.03
    assert_smooth(back[round((guide.parameters.stop_time + 4.0) / DT) :])
    alone = guidance()
    expected = fly(alone, 0.0, 25.0, [(9.0, lambda stamp: alone.stop(stamp, False))])
    gone_on = guide.scenario_time - alone.scenario_time
    assert 0.0 < gone_on < 10.0, "the path goes on once the vehicle is back on it"
    np.testing.assert_allclose(back[-1, 0, 1:6], expected[-1, 0, 1:6], atol=1e-9)


ACROSS, HEIGHT, TURN, SPEED = (
    st.floats(-2.0, 2.0), st.floats(0.5, 2.0), st.floats(-3.0, 3.0), st.floats(-0.5, 0.5)
)  # fmt: skip
FLOWN = st.tuples(ACROSS, ACROSS, HEIGHT, TURN, SPEED, SPEED, SPEED)


def state_of(flown):
    """Return a state (3, 8) of position [m], yaw [rad] and velocity [m/s]."""
    state = np.zeros((3, 8))
    state[0, :3], state[0, 5], state[1, :3] = flown[:3], flown[3], flown[4:]
    return state


def release(guide, begin, state, length=5.0, stow=False):
    """Stop at 100 + `begin` s, follow `state` for `length` s; return the stamp after it."""
    fly(guide, begin - 0.1, begin)
    guide.stop(100.0 + begin, stow)
    state[0, 6:] = fly(guide, begin, begin + length)[-1, 0, 6:]
    guide.follow(100.0 + begin + length, state)
    np.testing.assert_array_equal(guide.reference[0, :3], state[0, :3])
    assert guide.reference[0, 5] == state[0, 5]
    np.testing.assert_array_equal(guide.reference[1:, :6], 0.0)
    return begin + length


@settings(deadline=None, max_examples=20, phases=NO_SHRINKING)
@given(st.floats(0.5, 80.0), FLOWN, st.floats(0.02, 6.0), st.booleans())
def test_after_a_release_it_begins_at_pose_and_velocity_and_returns_to_the_path(
    at, flown, held, stow
):
    guide, state = guidance(), state_of(flown)
    back = release(guide, at, state, stow=stow)
    guide.advance(100.0 + back)
    guide.stay(100.0 + back, state, START[2])
    np.testing.assert_allclose(guide.reference[0, :3], state[0, :3], atol=1e-9)
    np.testing.assert_allclose(guide.reference[1, :3], state[1, :3], atol=1e-9)
    assert np.cos(guide.reference[0, 5] - state[0, 5]) == pytest.approx(1.0)
    time = guide.scenario_time
    references = fly(guide, back, back + held + 30.0, [(back + held, guide.go_on)])
    steps = np.abs(np.diff(references[:, :2], axis=0))
    assert np.max(steps[:, 0, :6]) < 0.02 and np.max(steps[:, 1, :6]) < 0.03
    assert np.max(steps[:, 0, 6:]) < 0.02
    np.testing.assert_allclose(  # rows are derivatives of each other
        (references[3:, 0] - references[1:-2, 0]) / (2 * DT), references[2:-1, 1], atol=5e-3
    )
    expected = empty_motion(2)
    load_scenario("pick_and_place").trajectory(START).write(guide.scenario_time, expected)
    np.testing.assert_allclose(references[-1], expected[:3], atol=1e-9)
    assert guide.scenario_time > time


def test_it_comes_to_rest_where_the_velocity_leads_before_it_goes_on():
    """0.5 m/s within half of the jerk ends after 0.5 t / 2, t = sqrt(5.7735 * 0.5 / 8) < 0.75 s.

    The command to go on comes while it brakes.
    """
    guide, state = guidance(), state_of((0.3, -0.2, 1.4, 0.0, 0.5, 0.0, 0.0))
    back = release(guide, 20.0, state)
    guide.advance(100.0 + back)
    guide.stay(100.0 + back, state, START[2])
    time = guide.scenario_time
    references = fly(guide, back, back + 12.0, [(back + 0.1, guide.go_on)])
    rest = references[round(0.75 / DT)]
    np.testing.assert_allclose(rest[0, :3], [0.3 + 0.25 * 0.75, -0.2, 1.4], atol=1e-4)
    np.testing.assert_allclose(rest[1:, :3], 0.0, atol=0.02)
    assert guide.scenario_time > time
    back += 12.0
    guide.stay(100.0 + back, state, START[2])
    guide.go_on(100.0 + back + 0.1)
    guide.stop(100.0 + back + 0.2, False)
    held = fly(guide, back, back + 6.0)
    np.testing.assert_array_equal(held[-1, 1:], 0.0)
    np.testing.assert_allclose(held[-1, 0, :3], rest[0, :3], atol=1e-4)


@settings(deadline=None, max_examples=10, phases=NO_SHRINKING)
@given(FLOWN, st.floats(0.5, 80.0), st.floats(0.05, 3.0))
def test_the_way_back_leads_straight_to_the_path(flown, at, held):
    """From the rest of the brake to the path at rest: in between, and nowhere else."""
    guide, state = guidance(), state_of(flown)
    back = release(guide, at, state, held)
    guide.advance(100.0 + back)
    guide.stay(100.0 + back, state, START[2])
    guide.go_on(100.0 + back)
    way, stamp = [], 100.0 + back
    while guide._away is not None or not way:
        stamp += DT
        guide.advance(stamp)
        guide.write(stamp)
        if guide._away is not None:
            way.append(guide.reference[0, :3].copy())
        assert stamp < 200.0 + back
    low, high = np.minimum(way[0], way[-1]), np.maximum(way[0], way[-1])
    assert np.all(np.array(way) > low - 0.01) and np.all(np.array(way) < high + 0.01)


def test_the_way_back_begins_once_the_shift_of_the_path_is_at_rest():
    """A shift by 5 cm takes 1.9 s, the brake from 0.1 m/s less; the way back begins at rest."""
    guide, shift = guidance(), Shift()
    state = state_of((-1.0, 0.0, 1.4, 0.0, 0.1, 0.0, 0.0))
    back = stamp = 100.0 + release(guide, 20.0, state)
    guide.shift = shift.add
    guide.stay(stamp, state, START[2])
    shift.aim(stamp, np.array([0.05, 0.0, 0.0]))
    guide.go_on(stamp)
    while guide._brake is not None:
        before = guide.motion[:3, 0].copy()
        stamp += DT
        guide.advance(stamp)
        shift.advance(stamp)
        guide.write(stamp)
        assert stamp < back + 3.0
    assert stamp > back + 1.8
    np.testing.assert_allclose(guide.motion[:3, 0], before, atol=1e-3)


def test_a_fast_vehicle_lands_from_its_brake_within_the_brakes_acceleration():
    """3 m/s and the command to land: at rest after 2 * 1.5 * 3 / 2 = 4.5 s, 6.75 m on."""
    guide, state = guidance(), state_of((0.0, 0.0, 1.4, 0.0, 3.0, 0.0, 0.0))
    back = release(guide, 20.0, state)
    guide.stay(100.0 + back, state, START[2])
    guide.descend(100.0 + back, state, START[2], True)
    references = fly(guide, back, back + 12.0)
    assert references[round(4.6 / DT), 0, 0] == pytest.approx(6.75, abs=1e-6)
    assert np.max(np.abs(references[:, 2, 0])) < 1.5


def test_a_joint_that_was_moved_by_hand_begins_at_its_angle():
    guide, state = guidance(), state_of((0.0, 0.0, 1.4, 0.0, 0.0, 0.0, 0.0))
    back = release(guide, 20.0, state)
    path, moved = state[0, 6:].copy(), state.copy()
    moved[0, 6] += 0.2
    guide.stay(100.0 + back, moved, START[2])
    np.testing.assert_array_equal(guide.reference[0, 6:], path)
    moved[0, 6] += 0.2  # beyond start_arm_error, 0.3 rad
    guide.stay(100.0 + back, moved, START[2])
    np.testing.assert_allclose(guide.reference[0, 6:], moved[0, 6:], atol=1e-12)
    references = fly(guide, back, back + 9.0, [(back + 0.1, guide.go_on)])
    assert np.max(np.abs(np.diff(references[:, 0, 6:], axis=0))) < 0.02
    expected = empty_motion(2)
    load_scenario("pick_and_place").trajectory(START).write(guide.scenario_time, expected)
    np.testing.assert_allclose(references[-1, 0, 6:], expected[0, 6:], atol=1e-6)


def test_a_sinking_vehicle_stops_above_the_ground():
    """From 0.3 m above the ground at 1.2 m/s it loses 0.18 m in 0.3 s; the others take longer."""
    guide, state = guidance(), state_of((0.0, 0.0, START[2] + 0.3, 0.0, 0.8, 0.0, -1.2))
    back = release(guide, 20.0, state)
    guide.advance(100.0 + back)
    guide.stay(100.0 + back, state, START[2])
    references = fly(guide, back, back + 6.0)
    assert np.min(references[:, 0, 2]) > START[2] + 0.10
    assert references[40, 1, 2] == pytest.approx(0.0, abs=1e-6) and references[40, 1, 0] > 0.1


def test_a_descent_that_is_interrupted_by_a_release_is_over():
    """The reference begins at the vehicle, not below it, and the scenario goes on where it was."""
    guide, state = guidance(), state_of((0.0, 0.0, 1.5, 0.0, 0.0, 0.0, 0.0))
    fly(guide, 19.9, 20.0)
    guide.descend(120.0, guide.reference.copy(), START[2], True)
    time = guide.scenario_time
    back = release(guide, 30.0, state)
    assert guide.end == np.inf
    guide.advance(100.0 + back)
    guide.stay(100.0 + back, state, START[2])
    assert guide.reference[0, 2] == pytest.approx(1.5)
    assert guide.reference[0, 6:] == pytest.approx(START[6:])
    assert guide.scenario_time == pytest.approx(time, abs=1.0)
    references = fly(guide, back, back + 60.0, [(back + 1.0, guide.go_on)])
    assert np.max(np.abs(np.diff(references[:, 0], axis=0))) < 0.02
    assert guide.scenario_time > time + 40.0


def test_a_state_that_is_not_finite_does_not_reach_the_reference():
    guide, state = guidance(), state_of((0.0, 0.0, np.nan, 0.0, 0.0, 0.0, 0.0))
    fly(guide, 19.9, 20.0)
    guide.stop(120.0, False)
    before = fly(guide, 20.0, 25.0)[-1]
    guide.stay(125.0, state, START[2])
    np.testing.assert_array_equal(guide.reference, before)


def test_the_preview_is_the_planned_path_up_to_a_length():
    flown = fly(guidance(), 0.0, 40.0)
    scenario, end = load_scenario("pick_and_place"), 90.0
    made = scenario.trajectory(START), 100.0, np.zeros((3, 8)), scenario.arm_start
    guide = Guidance(*made, MissionParameters(), end)
    fly(guide, 0.0, 10.0)
    stamps, chi = guide.preview(109.99, 0.25, 20.0)
    assert stamps[0] == pytest.approx(109.99) and 20.0 <= stamps[-1] - stamps[0] < 20.5
    np.testing.assert_allclose(chi, flown[999 : 999 + 25 * len(chi) : 25, 0], atol=1e-9)
    assert guide.preview(109.99, 0.25, 1e9)[0][-1] == pytest.approx(100.0 + end, abs=0.25)
    guide.stop(109.99, stow=False)
    fly(guide, 10.0, 20.0)
    stamps, chi = guide.preview(119.99, 0.25, 20.0)
    assert len(stamps) == len(chi) == 1
    guide.descend(119.99, guide.motion[:3], 0.28, stow=False)
    stamps, chi = guide.preview(119.99, 0.25, 2.0)
    assert stamps[-1] - stamps[0] == pytest.approx(2.0) and chi[-1, 2] < chi[0, 2]


def test_the_way_clear_of_a_stand_stays_within_the_geofence_and_off_other_stands():
    guide = guidance()

    def way(x, *stands, high=(5.0, 5.0, 6.0)):
        raised = [{"kind": "stand", "position": (*place, 0.0)} for place in stands]
        scenario = replace(load_scenario("hover"), environment=raised)
        parameters = MissionParameters(clear_distance=0.7, clear_height=0.2, geofence_high=high)
        watch = PayloadWatch(scenario, guide, parameters)
        return watch.clear(np.array([x, 0.0, 1.0, *np.zeros(5)]))

    stand, half = (1.0, 0.0), 0.7 * np.sqrt(0.75)
    assert not way(1.8, stand).any() and not way(1.8).any()
    np.testing.assert_allclose(way(1.2, stand), [0.5, 0.0, 0.2], atol=1e-12)
    np.testing.assert_allclose(way(1.0, stand), [0.7, 0.0, 0.2], atol=1e-12)  # above it
    # 30 degrees lead to x = 1.61, 60 degrees to 1 + 0.7 / 2
    fence = (1.5, 5.0, 1.1)
    np.testing.assert_allclose(way(1.2, stand, high=fence), [0.15, half, 0.1], atol=1e-12)
    other = (1.35, 0.9)
    np.testing.assert_allclose(way(1.2, stand, other, high=fence), [0.15, -half, 0.1], atol=1e-12)
    # 0.73 m from the other stand after 30 degrees, 0.55 m straight on
    np.testing.assert_allclose(
        way(1.2, stand, (2.25, 0.0)), [0.7 * np.sqrt(0.75) - 0.2, 0.35, 0.2], atol=1e-12
    )
