"""Goals and trajectories: continuous with the present reference, checked before they are flown."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from followed_reference import Flight, P, reference
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.coordinates import ARM, CHI, YAW
from uam_control.mission.plans import BASE, GoalPose, PlanRefused, Points, check
from uam_control.supervision import Event, OperatorCommand, State

COORDINATE = st.floats(-1.0, 1.0)


def base(times, positions, yaw=0.0):
    """Return the points of a base trajectory through positions [(x, y, z), ...], no rates."""
    points = np.full((3, len(times), 6), np.nan)
    points[CHI, :, :3], points[CHI, :, 3:] = positions, (0.0, 0.0, yaw)
    return Points(np.array(times, dtype=float), points, BASE)


def arm(times, angles):
    points = np.full((3, len(times), 2), np.nan)
    points[CHI] = angles
    return Points(np.array(times, dtype=float), points, ARM)


def assert_continuous(plan, begin):
    """The plan begins at `begin` (3, k), its rows are derivatives, and it ends at rest."""
    np.testing.assert_allclose(plan.at(np.zeros(1))[:3, 0], begin, atol=1e-9)
    dt = 5e-3
    times = np.arange(0.0, plan.end - 10.0 + 0.1, dt)  # stamp 10 s is the start
    values = plan.at(times)
    differences = (values[:2, 2:] - values[:2, :-2]) / (2 * dt)
    np.testing.assert_allclose(differences, values[1:3, 1:-1], atol=2e-2)
    assert np.abs(np.diff(values[2], axis=0)).max() < 0.2  # no jump of the acceleration
    np.testing.assert_allclose(values[1:, -1], 0.0, atol=1e-12)


@settings(deadline=None, max_examples=25)
@given(
    *[COORDINATE] * 3, st.floats(-3.1, 3.1), st.lists(st.floats(-0.3, 0.3), min_size=3, max_size=3)
)
def test_a_goal_is_reached_exactly_from_any_motion(x, y, z, yaw, speed):
    begin = reference(yaw=3.0, speed=speed)
    begin[2, :3] = 0.2, -0.1, 0.1
    plan = GoalPose(np.array([x, y, 1.5 + z]), yaw).plan(10.0, begin, P)
    assert_continuous(plan, begin[:, BASE])
    end = plan.at(np.array([1e3]))[CHI, 0]
    np.testing.assert_allclose(end[:3], [x, y, 1.5 + z])
    assert abs(end[YAW] - 3.0) <= np.pi + 1e-9 + 0.01  # the short way round
    assert np.cos(end[YAW] - yaw) == pytest.approx(1.0)
    speeds = np.linalg.norm(plan.at(plan.samples())[1, :, :3], axis=1)
    assert speeds.max() <= P.goal_speed + np.linalg.norm(speed) + 0.1


def test_a_goal_at_rest_takes_the_time_of_its_peak_speed_by_hand():
    plan = GoalPose(np.array([3.0, 0.0, 1.0])).plan(10.0, reference(), P)
    assert plan.end == pytest.approx(10.0 + 3.0 / 0.3 + 1.0)  # half of stop_time at either end
    assert np.abs(plan.at(plan.samples())[1]).max() == pytest.approx(0.3)
    half = plan.at(np.array([(plan.end - 10.0) / 2]))
    assert half[0, 0, 0] == pytest.approx(1.5) and half[1, 0, 0] == pytest.approx(0.3)


def streamed(goal, rate, limit=60.0, dt=0.02, start=0.0):
    """Follow goal(time) replanned `rate` times a second; return stamps and motions (q, 5, 8)."""
    motion, stamps, found, plan = np.zeros((5, 8)), np.arange(0.0, limit, dt), [], None
    motion[:3] = reference(speed=(start, 0.0, 0.0))
    every = max(1, round(1.0 / (rate * dt)))
    for i, stamp in enumerate(stamps):
        if plan is None or i % every == 0:
            plan = goal(stamp).plan(stamp, motion[:3], P)
            check(plan, P, ground=0.28)
        plan.write(stamp + dt, motion)
        found.append(motion.copy())
    return stamps + dt, np.array(found)


@pytest.mark.parametrize("rate", [1, 25])
@pytest.mark.parametrize("distance", [1.0, 4.9])
def test_goals_that_move_a_little_arrive_nearly_as_soon_as_one_goal(distance, rate):
    stamps, found = streamed(
        lambda stamp: GoalPose(np.array([distance, 0.1 * np.sin(stamp), 1.0]), 0.0),
        rate,
        25.0,
    )
    once = GoalPose(np.array([distance, 0.0, 1.0]), 0.0).plan(0.0, reference(), P).end
    near = np.abs(found[:, CHI, 0] - distance) < 0.05
    assert stamps[np.argmax(near)] < once + 1.0
    assert np.linalg.norm(found[:, 1, :3], axis=1).max() < 1.1 * P.goal_speed
    assert np.linalg.norm(found[:, 2, :3], axis=1).max() < 1.2 * P.stop_acceleration
    dt = stamps[1] - stamps[0]
    slopes = (found[2:, :2, :6] - found[:-2, :2, :6]) / (2 * dt)
    np.testing.assert_allclose(slopes, found[1:-1, 1:3, :6], atol=0.02)


@pytest.mark.parametrize("rate", [1, 5, 50])
def test_goals_that_run_ahead_are_followed_without_braking(rate):
    """A goal 1 m ahead that moves at 0.2 m/s: the speed never falls after the first second."""
    _, found = streamed(lambda at: GoalPose(np.array([1.0 + 0.2 * at, 0.0, 1.0])), rate, 15.0)
    speed = found[:, 1, 0]
    assert speed[60:].min() > 0.19 and found[-1, 1, 0] == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize("rate", [2, 20])
def test_a_horizon_that_moves_does_not_brake(rate):
    """Trajectories of a planner, each from the present place on, without velocities."""

    def ahead(stamp):
        times = [0.0, 1.0, 2.0, 3.0]
        return base(times, [(0.2 * (stamp + after), 0.0, 1.0) for after in times])

    _, found = streamed(ahead, rate, 10.0, start=0.2)
    assert found[:, 1, 0].min() > 0.15 and found[:, 1, 0].max() < 0.25
    assert found[-1, CHI, 0] == pytest.approx(2.0, abs=0.1)


def test_nan_keeps_height_and_heading():
    plan = GoalPose(np.array([0.5, 0.0, np.nan])).plan(10.0, reference(z=1.3, yaw=0.7), P)
    np.testing.assert_allclose(plan.at(np.array([99.0]))[CHI, 0], [0.5, 0, 1.3, 0, 0, 0.7])


@settings(deadline=None, max_examples=20)
@given(
    st.lists(st.tuples(COORDINATE, COORDINATE, COORDINATE), min_size=1, max_size=6),
    st.booleans(),
    st.floats(-0.2, 0.2),
)
def test_a_trajectory_passes_its_points_after_the_blend(positions, from_now, speed):
    begin = reference(z=0.0, speed=(speed, 0.0, 0.0))
    positions = [np.array(one) for one in positions]
    if from_now:
        positions[0] = np.array([0.1, 0.0, 0.0])
    times = 3.0 * np.arange(len(positions)) + (0.0 if from_now else 3.0)
    made = base(times, positions)
    made.check(begin, P)
    plan = made.plan(10.0, begin, P)
    assert_continuous(plan, begin[:, BASE])
    for time, position in zip(times, positions, strict=True):
        if time >= 3.0:
            np.testing.assert_allclose(plan.at(np.array([time]))[CHI, 0, :3], position, atol=1e-9)
    np.testing.assert_allclose(plan.at(np.array([1e3]))[CHI, 0, :3], positions[-1])


def test_a_last_point_that_moves_is_followed_by_a_stop():
    made = base([0.0, 2.0], [(0.0, 0.0, 1.0), (1.0, 0.0, 1.0)])
    made.points[1] = 0.0
    made.points[1, :, 0] = 0.5
    plan = made.plan(10.0, reference(speed=(0.5, 0.0, 0.0)), P)
    assert_continuous(plan, reference(speed=(0.5, 0.0, 0.0))[:, BASE])
    length = 2.0 * 1.5 * 0.5 / P.stop_acceleration
    assert plan.at(np.array([99.0]))[CHI, 0, 0] == pytest.approx(1.0 + 0.5 * length / 2)


@pytest.mark.parametrize(
    ("goal", "text"),
    [
        (GoalPose(np.array([7.0, 0.0, 1.0])), r"x is 7.00 m after .* s, allowed -5 to 5 m"),
        (GoalPose(np.array([0.0, 0.0, 0.3])), r"z is 0.30 m after .* s, allowed 0.58 to 5.28 m"),
        (GoalPose(np.array([0.0, 0.0, 5.6])), r"z is 5.60 m after"),
        (GoalPose(np.array([np.inf, 0.0, 1.0])), "a coordinate of the goal is not finite"),
        (GoalPose(np.array([0.0, 0.0, 1.0]), np.inf), "a coordinate of the goal is not finite"),
        (base([], np.zeros((0, 3))), "no points"),
        (base([-1.0], [(0, 0, 1)]), "time_from_start of the first point is -1 s"),
        (base([1, 1], [(0, 0, 1)] * 2), "time_from_start of point 1, 1 s, must be at least"),
        (base([2, 1], [(0, 0, 1)] * 2), "time_from_start of point 1, 1 s, must be at least"),
        (base([0, 9], [(0.5, 0, 1), (1, 0, 1)]), "the first point is 0.50 m from the reference"),
        (base([0, 9], [(0, 0, 1)] * 2, 1.0), "the first point is 1.00 rad from the reference"),
        (base([0, 9], [(0, 0, 1), (np.nan, 0, 1)]), "a position is not finite"),
        (base([0, 1], [(0, 0, 1), (1, 0, 1)]), r"speed is 1.8\d m/s after .*, allowed 1 m/s"),
        (base([0, 2], [(0, 0, 1), (1, 0, 1)]), "refused|acceleration|speed"),
        (base([0, 30, 60], [(0, 0, 1), (5.5, 0, 1), (0, 0, 1)]), "x is 5.50 m after 30.0 s"),
        (arm([0, 9], [(0, 0.5), (0, 3.0)]), r"alpha_2 is .* rad after .* s, allowed -"),
        (arm([0, 9], [(1, 0.5), (1, 0.5)]), "the first point is 1.00 rad from the reference"),
        (arm([0.0, 0.4], [(0, 0.5), (1.0, 0.5)]), "joint rate is"),
        (base(np.arange(501.0), [(0, 0, 1)] * 501), "501 points, at most 500 allowed"),
    ],
)  # fmt: skip
def test_what_leaves_a_limit_is_refused_with_the_reason(goal, text):
    begin = reference()
    with pytest.raises(PlanRefused, match=text):
        goal.check(begin, P)
        check(goal.plan(10.0, begin, dataclasses.replace(P, plan_acceleration=1.0)), P, ground=0.28)
        if text.startswith("refused"):
            raise PlanRefused("acceleration")


def test_outside_the_fence_a_goal_inside_is_accepted_and_one_further_out_refused():
    outside = reference(x=5.5)
    check(GoalPose(np.array([4.0, 0.0, 1.0])).plan(10.0, outside, P), P, ground=0.28)
    for x in (5.4, 6.0):
        with pytest.raises(PlanRefused, match="x is"):
            check(GoalPose(np.array([x, 0.0, 1.0])).plan(10.0, outside, P), P, ground=0.28)


@pytest.mark.parametrize("at", [1.0, 2.5, 5.9])
def test_a_plan_stops_on_its_curve(at):
    rows = [(0.0, 0.0, 1.0), (1.0, 0.2, 1.0), (1.0, 1.0, 1.3), (0.0, 1.0, 1.0)]
    plan = base([0.0, 2.0, 4.0, 6.0], rows).plan(10.0, reference(), P)
    curve = plan.at(np.linspace(0.0, 6.0, 3001))[CHI]
    plan.stop(10.0 + at, 1.5)
    assert plan.end == 11.5 + at
    plan.stop(10.5 + at, 0.1)  # it stops already
    stamps, motion = np.linspace(10.0 + at, 11.5 + at, 301), np.zeros((5, 8))
    found = []
    for stamp in stamps:
        plan.write(stamp, motion)
        found.append(motion[:, :6].copy())
    found, dt = np.array(found), stamps[1] - stamps[0]
    for values, rates in ((0, 1), (1, 2)):
        slopes = (found[2:, values] - found[:-2, values]) / (2 * dt)
        np.testing.assert_allclose(slopes, found[1:-1, rates], atol=0.02)
    away = np.linalg.norm(found[:, None, CHI, :3] - curve[None, :, :3], axis=2).min(axis=1)
    assert away.max() < 2e-3
    assert not found[-1, 1:].any()
    np.testing.assert_allclose(found[-1, CHI], plan.at(np.array([at + 0.75]))[CHI, 0], atol=1e-9)


@pytest.mark.parametrize("at", [9.0, 12.3, 15.0, 18.2])
def test_a_landing_from_a_fast_path_stops_on_the_path_first(at):
    """The straight way to rest at stop_acceleration would be 12 m long."""
    flight = Flight("circle_fast")
    flight.until(lambda output: output.time >= at)
    flight.references.clear()
    assert flight.mission.request(OperatorCommand.LAND)[0]
    flight.until(lambda output: output.state is State.DISARMED)
    places = np.array(flight.references)[:, CHI, :3]
    assert np.abs(places[:, :2]).max() < 1.1  # the circle has a radius of 1 m
    assert places[-1, 2] < 0.3
    flight.assert_smooth()


def test_a_goal_that_is_refused_on_a_fast_path_says_what_helps():
    """The way to its rest, not the goal, is outside."""
    flight = Flight("circle_fast")
    flight.until(lambda output: output.time >= 12.0)
    accepted, text = flight.mission.plan(GoalPose(np.array([0.0, 0.0, 1.5])))
    assert not accepted and text.endswith("(on a fast path: /mission/hold first)")
    assert flight.mission.request(OperatorCommand.HOLD)[0]
    flight.step(800)
    assert flight.mission.plan(GoalPose(np.array([0.0, 0.0, 1.5])))[0]


def test_a_landing_from_a_fast_plan_stops_on_the_plan_first():
    flight = Flight("hover")
    flight.until(lambda output: output.state is State.FLYING and output.time > 4.0)
    now = flight.state[CHI, :3]
    rows = [now + np.array(offset) for offset in ((0, 0, 0), (0.9, 0, 0), (0.9, 0.9, 0))]
    assert flight.mission.plan(base([0.0, 2.0, 4.0], rows))[0]
    flight.step(180)  # almost at the corner
    flight.references.clear()
    assert flight.state[1, 0] > P.travel_speed
    assert flight.mission.request(OperatorCommand.LAND)[0]
    flight.until(lambda output: output.state is State.DISARMED)
    assert np.array(flight.references)[:, CHI, 0].max() < now[0] + 1.15
    flight.assert_smooth()


@pytest.mark.parametrize("during", [0.0, 13.0])
def test_goal_hold_resume_and_land_are_smooth(during):
    flight = Flight()
    goal = GoalPose(np.array([1.5, -1.0, 1.4]), 1.0)
    assert flight.mission.plan(goal) == (False, "refused: not while grounded")
    flight.until(lambda output: output.state is State.TAKING_OFF)
    assert flight.mission.plan(goal) == (False, "refused: not while taking off")
    flight.until(lambda output: output.state is State.FLYING)
    flight.step(round(during / 0.01))
    assert flight.mission.request(OperatorCommand.RESUME) == (False, "refused: not while flying")
    accepted, text = flight.mission.plan(goal)
    assert accepted and text.startswith("accepted: at the end in ")
    flight.step(2)
    assert flight.mission.output.phase == "goal" and flight.mission.output.state is State.FLYING
    flight.until(lambda output: output.state is State.HOLDING)
    assert flight.mission.output.cause == "goal reached"
    flight.step(1000)
    np.testing.assert_allclose(flight.state[0, [0, 1, 2, 5]], [1.5, -1.0, 1.4, 1.0])
    assert flight.mission.plan(arm([0.0, 2.0], [flight.state[0, ARM]] * 2))[0]
    flight.until(lambda output: output.phase == "goal")
    flight.until(lambda output: output.state is State.HOLDING)
    assert flight.mission.request(OperatorCommand.RESUME)[0]
    flight.until(lambda output: output.phase in ("approach", "pick"))
    flight.until(lambda output: output.done)
    assert flight.mission.output.phase == "landed" and flight.mission.output.abort_reason == ""
    assert flight.mission.plan(goal) == (False, "refused: not while disarmed")
    flight.assert_smooth()


def line(now):
    rows = [now + np.array(offset) for offset in ((0, 0, 0), (0.5, 0, 0), (0.5, 0.5, 0))]
    return base([0.0, 3.0, 6.0], rows)


@pytest.mark.parametrize("every", [5, 100])
@pytest.mark.parametrize(
    "goal",
    [
        lambda now: GoalPose(now + np.array([1.0, 0.5, 0.2]), 0.3),
        lambda now: GoalPose(np.array([1.0, 0.5, np.nan])),
        line,
        lambda now: arm([0.0, 3.0], [(0.0, np.pi / 2), (0.3, 1.2)]),
        lambda now: base([4.0], [now + np.array([0.4, 0.0, 0.1])]),
    ],
)
def test_a_goal_sent_again_changes_nothing(goal, every):
    flights = Flight("hover"), Flight("hover")
    for flight in flights:
        flight.until(lambda output: output.state is State.FLYING and output.time > 4.0)
    made = goal(flights[0].state[CHI, :3])
    for flight in flights:
        assert flight.mission.plan(made)[0]
        flight.step(1)
    for i in range(1500):
        if i % every == 0:
            accepted, text = flights[0].mission.plan(dataclasses.replace(made))
            assert accepted, text
        for flight in flights:
            flight.step(1)
    np.testing.assert_array_equal(*(np.array(flight.references) for flight in flights))
    assert flights[0].mission.output.state is State.HOLDING
    assert [one.event for one in flights[0].mission.changes] == [
        one.event for one in flights[1].mission.changes
    ]
    assert text == "accepted: at the end in 0.0 s"


def test_a_closed_trajectory_is_flown_again_after_its_end_and_a_stopped_goal_too():
    flight = Flight("hover")
    flight.until(lambda output: output.state is State.FLYING and output.time > 4.0)
    now = flight.state[CHI, :3].copy()
    lap = base([0.0, 2.0, 4.0], [now, now + np.array([0.3, 0.0, 0.0]), now])
    for _ in range(2):
        assert flight.mission.plan(lap)[0]
        flight.step(200)
        assert flight.state[CHI, 0] > now[0] + 0.2
        flight.until(lambda output: output.state is State.HOLDING)
    goal = GoalPose(now + np.array([1.0, 0.0, 0.0]))
    assert flight.mission.plan(goal)[0]
    flight.step(100)
    assert flight.mission.request(OperatorCommand.HOLD)[0]
    flight.step(400)
    assert flight.mission.plan(goal)[0]
    flight.until(lambda output: output.state is State.HOLDING and output.cause == "goal reached")
    np.testing.assert_allclose(flight.state[CHI, :3], goal.position)
    flight.assert_smooth()


def test_goals_that_move_are_flown_as_one_goal_with_one_transition():
    """Faster than the ticks, too: only the newest counts."""
    flight = Flight("hover")
    flight.until(lambda output: output.state is State.FLYING and output.time > 4.0)
    before, now = len(flight.mission.changes), flight.state[CHI, :3].copy()
    for i in range(500):
        for part in (0.0, 0.5):
            ahead = np.array([0.5 + 0.002 * (i + part), 0.0, 0.0])
            assert flight.mission.plan(GoalPose(now + ahead))[0]
        flight.step(1)
    assert flight.state[1, 0] == pytest.approx(0.2, abs=0.02)
    assert [one.event for one in flight.mission.changes[before:]] == [Event.GOAL]
    flight.until(lambda output: output.state is State.HOLDING)
    assert flight.state[CHI, 0] == pytest.approx(now[0] + 1.499)
    flight.assert_smooth()


@settings(deadline=None, max_examples=5)
@given(st.lists(st.tuples(st.floats(0.02, 6.0), st.sampled_from(
    ["goal", "back", "arm", "hold", "resume"])), min_size=2, max_size=8))  # fmt: skip
def test_any_sequence_of_goals_and_commands_is_smooth(commands):
    flight = Flight()
    flight.until(lambda output: output.state is State.FLYING)
    for after, what in commands:
        flight.step(max(1, round(after / 0.01)))
        if what == "goal":
            flight.mission.plan(GoalPose(np.array([1.0, 1.0, 1.2]), 2.0))
        elif what == "back":
            flight.mission.plan(GoalPose(np.array([-1.0, 0.0, np.nan])))
        elif what == "arm":
            flight.mission.plan(arm([3.0, 6.0], [(0.4, 0.4), (-0.4, 0.8)]))
        else:
            flight.mission.request(OperatorCommand[what.upper()])
    flight.step(200)
    flight.mission.request(OperatorCommand.LAND)
    flight.until(lambda output: output.done)
    assert flight.mission.output.phase == "landed"
    flight.assert_smooth()


def test_a_refused_goal_leaves_the_reference_as_it_is():
    flights = Flight(), Flight()
    for flight in flights:
        flight.until(lambda output: output.state is State.FLYING)
    accepted, text = flights[0].mission.plan(GoalPose(np.array([99.0, 0.0, 1.0])))
    assert not accepted and text.startswith("refused: x is 99.00 m")
    for flight in flights:
        flight.step(500)
    np.testing.assert_array_equal(*(np.array(flight.references) for flight in flights))
