"""Goals of the end effector: solved for base and arm, flown together, refused with the reason.

The vehicle follows its reference exactly; the forward kinematics judge where the hand comes to.
"""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from followed_reference import Flight, limits
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from uam_control.arm.hand import hinge_angles, tools
from uam_control.arm.placing import Room, placed, turning
from uam_control.coordinates import ARM, CHI, CHI_DOT, YAW
from uam_control.mission.hand_goals import HandPoints, HandPose, HandTwist, base_room, joint_room
from uam_control.mission.motion.flatness import Flyer, flattened
from uam_control.mission.plans import GoalPose, PlanRefused, check
from uam_control.profiles.profile import default_profile
from uam_control.supervision import Event, OperatorCommand, State
from uam_control.vehicle import load_description

VEHICLES = {name: load_description(name) for name in ("s500_arm", "s500_arm3", "t650")}
FLYERS = {name: Flyer.of(vehicle) for name, vehicle in VEHICLES.items()}
FREE = math.nan
ROOM = np.array([[-5.0, -5.0, 0.6], [5.0, 5.0, 5.0]])


def ranges(name):
    return np.array([(one.low, one.high) for one in VEHICLES[name].joints]).T


def room(name):
    return Room(ROOM, ranges(name), np.array(FLYERS[name].hinge))


def hovering(name="s500_arm", **parameters):
    flight = Flight("hover", VEHICLES[name], **parameters)
    flight.until(lambda output: output.state is State.FLYING and output.time > 4.0)
    return flight


def hand(name, chi):
    return tools(FLYERS[name].chain, np.atleast_2d(chi))[-1]


def pose(name, *wanted):
    return HandPose(FLYERS[name], np.array([*wanted, *[FREE] * (6 - len(wanted))]))


def twist(name, linear, angular=(0.0, 0.0, 0.0), of_tool=False):
    return HandTwist(FLYERS[name], np.array(linear), np.array(angular), of_tool)


@settings(deadline=None, max_examples=60)
@given(
    st.sampled_from(sorted(VEHICLES)),
    st.lists(st.floats(0.02, 0.98), min_size=8, max_size=8),
)
def test_every_pose_that_a_vehicle_can_have_is_found(name, shares):
    low, high = ranges(name)
    chi = np.zeros(6 + len(low))
    chi[:3] = ROOM[0] + np.array(shares[:3]) * (ROOM[1] - ROOM[0])
    chi[YAW] = 6.28 * shares[3] - 3.14
    chi[ARM] = low + np.array(shares[4 : 4 + len(low)]) * (high - low)
    wanted = tools(FLYERS[name].chain, chi[None])
    stowed = np.array(VEHICLES[name].stowed)
    found = placed(FLYERS[name].chain, wanted, stowed, room(name))
    apart = tools(FLYERS[name].chain, found.chi) - wanted
    np.testing.assert_allclose(apart[0, :3], 0.0, atol=1e-6)
    np.testing.assert_allclose(np.cos(apart[0, 3:]), 1.0, atol=1e-9)
    assert not np.abs(found.off).max() > 1e-6
    assert (found.chi[0, :3] >= ROOM[0] - 1e-6).all() and (found.chi[0, :3] <= ROOM[1] + 1e-6).all()
    assert (found.chi[0, ARM] >= low).all() and (found.chi[0, ARM] <= high).all()
    hinge = hinge_angles(FLYERS[name].chain, found.chi[:, ARM])
    assert FLYERS[name].hinge[0] - 1e-6 <= hinge[0] <= FLYERS[name].hinge[1] + 1e-6


def test_a_hinge_is_counted_on_over_half_a_turn_by_hand():
    """It turns back by what the three joints turn together; that of the t650's hand does not."""
    arms = [0.0, 90.0, 0.0], [45.8, 107.1, 25.2], [90.0, 100.0, 30.0], [-110.0, -90.0, 0.0]
    found = hinge_angles(FLYERS["s500_arm3"].chain, np.radians(arms))
    np.testing.assert_allclose(np.degrees(found), [-90.0, -178.1, -220.0, 200.0], atol=1e-9)
    assert not hinge_angles(FLYERS["t650"].chain, np.ones((1, 4))).any()


def test_no_arm_is_raised_so_far_that_the_magnet_lies_on_the_end_of_its_hinge():
    """The hinge of the S-500's magnet turns by 150 deg, and 0.1 rad are kept for the base's tilt.

    The hand is to be 12 mm above the base. Joints of 45.8, 107.1 and 25.2 deg would do; they make
    178 deg, and the magnet hung 28 deg askew.
    """
    name, posture = "s500_arm3", np.radians([45.8, 107.1, 25.2])
    low, high = np.degrees(FLYERS[name].hinge)
    np.testing.assert_allclose([low, high], [-150.0, 150.0])
    chi = np.zeros((1, 9))
    chi[0, ARM] = posture
    high_up = tools(FLYERS[name].chain, chi)
    high_up[:, 3:] = 0.0, FREE, FREE
    space = np.array([[-1.0, -1.0, -0.3], [1.0, 1.0, 0.0]])
    ends = np.radians([-150.0, 150.0]) + (0.1, -0.1)
    found = placed(FLYERS[name].chain, high_up, posture, Room(space, ranges(name), ends))
    assert np.degrees(found.chi[0, ARM]).sum() <= 150.0 - 5.72
    np.testing.assert_allclose(
        tools(FLYERS[name].chain, found.chi)[0, :4], high_up[0, :4], atol=1e-6
    )


def test_the_base_does_what_it_can_alone_by_hand():
    """The S-500's magnet hangs 0.14 m ahead and 0.203 m below when it is stowed."""
    wanted = np.array([[1.0, 2.0, 0.9, math.pi / 2, FREE, FREE]])
    stowed = np.array([0.0, math.pi / 2])
    found = placed(FLYERS["s500_arm"].chain, wanted, stowed, room("s500_arm"))
    expected = [1.0, 2.0 - 0.14, 0.9 + 0.203, 0.0, 0.0, math.pi / 2, 0.0, math.pi / 2]
    np.testing.assert_allclose(found.chi[0], expected, atol=1e-9)


def test_the_arm_reaches_down_where_the_base_may_not():
    wanted = np.array([[0.0, 0.0, 0.35, 0.0, FREE, FREE]])
    stowed = np.array([0.0, math.pi / 2])
    found = placed(FLYERS["s500_arm"].chain, wanted, stowed, room("s500_arm"))
    assert found.chi[0, 2] == pytest.approx(0.6) and not np.abs(found.off).max() > 1e-6
    assert abs(found.chi[0, 7]) < 1.4


@pytest.mark.parametrize("name", sorted(VEHICLES))
def test_rates_of_base_and_arm_move_the_tool_so(name):
    chi = np.array([1.0, 2.0, 1.5, 0.0, 0.0, 0.7, *[0.3] * len(VEHICLES[name].joints)])
    rates = np.array([0.1, -0.2, 0.05, 0.3, 0.2 * (name == "t650"), 0.0])
    found, missed = turning(FLYERS[name].chain, chi, rates)
    moved = hand(name, chi + 1e-6 * found) - hand(name, chi)
    np.testing.assert_allclose(moved / 1e-6, rates, atol=1e-4)
    np.testing.assert_allclose(missed, 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("s500_arm", (0.5, 0.2, 0.6, 0.5)),
        ("s500_arm", (0.5, 0.2, 0.3)),
        ("s500_arm3", (-0.3, 0.2, 0.26, 2.0)),
        ("t650", (0.5, 0.2, 0.8, -3.0, 0.3, 0.0)),
        ("t650", (0.1, -0.4, 0.9, 1.0, 1.0, 0.1)),
    ],
)
def test_a_pose_is_reached_by_base_and_arm_together(name, wanted):
    flight, goal = hovering(name), pose(name, *wanted)
    before = hand(name, flight.state[CHI])
    accepted, text = flight.mission.plan(goal)
    assert accepted, text
    arrived = flight.stamp + float(text.split()[-2])
    flight.until(lambda output: output.state is State.FLYING and output.phase == "goal")
    flight.until(lambda output: output.state is State.HOLDING)
    assert flight.stamp == pytest.approx(arrived, abs=0.07)  # 0.1 s in the text
    found, expected = hand(name, flight.state[CHI]), np.array([*wanted, *[FREE] * 6])[:6]
    expected = np.where(np.isnan(expected), found, expected)
    expected[3] = before[3] if len(wanted) < 4 else wanted[3]
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert flight.mission.plan(pose(name, *wanted)) == (True, "accepted: at the end in 0.0 s")
    flight.assert_smooth()


@pytest.mark.parametrize("yaw", [0.3, 1.1, 2.9])
def test_a_goal_with_the_base_at_the_corner_of_its_room_is_flown(yaw):
    """The last digit of the sine must not count. At 5 m the supervisor holds: 0.05 m stay free."""
    flight = hovering()
    corner = np.array([4.95, 4.95, 0.6, 0.0, 0.0, yaw, 0.0, math.pi / 2])
    accepted, text = flight.mission.plan(pose("s500_arm", *hand("s500_arm", corner)[:4]))
    assert accepted, text
    highest = np.array([5.0, 5.0, flight.limits.altitude_hold])
    np.testing.assert_allclose(base_room(flight.limits, 0.0)[1], highest - 0.05)


def test_another_goal_of_the_base_replaces_the_hand_and_keeps_the_arm():
    flight = hovering()
    assert flight.mission.plan(pose("s500_arm", 0.5, 0.2, 0.3))[0]
    flight.step(40)
    assert flight.mission.plan(GoalPose(np.array([0.0, 0.0, 1.0])))[0]
    flight.until(lambda output: output.state is State.HOLDING)
    np.testing.assert_allclose(flight.state[CHI, :3], [0.0, 0.0, 1.0], atol=1e-9)
    flight.assert_smooth()


@pytest.mark.parametrize(
    ("goal", "text"),
    [
        (pose("s500_arm", 9.0, 0.0, 1.0), "out of reach: the base would be at x = 8.7"),
        (pose("s500_arm", 0.0, 0.0, 0.1), "out of reach: the base would be at z = 0.44 m"),
        (pose("s500_arm", 0.0, 0.0, -0.1), "out of reach: the hand's z is -0.10 m, the floor is"),
        (pose("s500_arm", 1e308, -1e308, 1.0), "out of reach: a place is more than 100 m outside"),
        (pose("t650", 0.0, 1e16, 1.0, 0.0, 0.1, 0.1), "out of reach: a place is more than 100 m"),
        (pose("s500_arm", FREE, 0.0, 1.0), "a coordinate of the goal is not finite"),
        (pose("s500_arm", 0.0, 0.0, 1.0, math.inf), "a coordinate of the goal is not finite"),
        (pose("s500_arm", 0.0, 0.0, 1.0, 0.0, 0.4, 0.0), "the arm leaves the tool 23 deg from its"),
        (pose("s500_arm", 0.0, 0.0, 1.0, 0.0, 0.0, 1.5), "singular: the tool's y axis leans by 86"),
        (twist("s500_arm", (0.1, FREE, 0.0)), "a velocity is not finite"),
        (twist("s500_arm", (0.0, 3.0, 4.0)), "too fast: 5 m/s, 1 m/s allowed"),
        (twist("s500_arm", (1e308, 0.0, 1e308)), "too fast: 1.41e+308 m/s"),
        (twist("s500_arm", (0.0, 0.0, 0.0), (0.0, 0.2, 0.0)), "the arm cannot turn the tool so"),
    ],
)  # fmt: skip
def test_a_refusal_says_why(goal, text):
    flight = hovering()
    before = len(flight.mission.changes)
    accepted, answer = flight.mission.plan(goal)
    assert not accepted and text in answer and "\n" not in answer
    flight.step(2)
    assert len(flight.mission.changes) == before


def points(name, times, rows, rates=None):
    wanted = np.array([[*row, FREE, FREE] for row in rows])
    given = np.full((2, len(times), 4), np.nan) if rates is None else rates
    return HandPoints(FLYERS[name], np.array(times, dtype=float), wanted, given)


def test_a_trajectory_of_the_hand_counts_the_tilt_of_the_base():
    """On a curve with velocities the hand of the flown reference passes within 1 mm."""
    flight = hovering()
    x, y, z = hand("s500_arm", flight.state[CHI])[:3]
    times = np.arange(0.0, 12.01, 0.25)
    u = times / 12.0
    turn = 2.0 * np.pi * (10 * u**3 - 15 * u**4 + 6 * u**5)
    rows = np.column_stack([x + 0.3 * np.sin(turn), y + 0.3 - 0.3 * np.cos(turn),
                            np.full_like(u, z), np.zeros_like(u)])  # fmt: skip
    flight.references.clear()
    accepted, text = flight.mission.plan(points("s500_arm", times, rows))
    assert accepted, text
    flight.until(lambda output: output.state is State.HOLDING)
    flown = np.array(flight.references)[50:1200]  # after the blend
    flattened(flown := flown.swapaxes(0, 1).copy(), FLYERS["s500_arm"])
    found = tools(FLYERS["s500_arm"].chain, flown[CHI])[:, :2]
    away = np.hypot(found[:, 0] - x, found[:, 1] - y - 0.3)
    np.testing.assert_allclose(away, 0.3, atol=1e-3)
    flight.assert_smooth()


@pytest.mark.parametrize(
    ("times", "rows", "text"),
    [
        ([0.0, 0.3], [(0, 0, 0), (0.5, 0, 0)], r"speed is .* allowed 1 m/s"),
        ([0.0, 9.0], [(0, 0, 0), (9.0, 0, 0)], "out of reach: point 1: the base would be at x"),
        ([0.0, 9.0], [(0.5, 0, 0), (0, 0, 0)], "the first point is 0.50 m from the reference"),
        ([2.0, 1.0], [(0, 0, 0), (0, 0, 0)], "time_from_start of point 1"),
        ([0.0, 9.0], [(0, 0, 0), (0, FREE, 0)], "a position is not finite"),
    ],
)  # fmt: skip
def test_a_trajectory_is_checked_as_the_bases(times, rows, text):
    flight = hovering()
    here = hand("s500_arm", flight.state[CHI])
    made = points("s500_arm", times, [(*(here[:3] + row), 0.0) for row in rows])
    accepted, answer = flight.mission.plan(made)
    assert not accepted and re.search(text, answer), answer


def test_velocities_that_no_base_can_have_are_refused():
    flight = hovering()
    here = hand("s500_arm", flight.state[CHI])
    for size in (1e308, 1e16, 50.0):
        made = points("s500_arm", [0.0, 9.0], [(*here[:3], 0.0)] * 2, np.full((2, 2, 4), size))
        with np.errstate(all="ignore"):
            accepted, answer = flight.mission.plan(made)
        assert not accepted and answer.startswith("refused: "), answer


def jogged(flight, goal, seconds, every=5):
    """Send a jog `every` ticks of 10 ms."""
    for _ in range(round(100 * seconds / every)):
        accepted, text = flight.mission.plan(goal)
        assert accepted, text
        flight.step(every)


@pytest.mark.parametrize("name", sorted(VEHICLES))
def test_a_jog_moves_the_hand_and_ends_when_the_messages_do(name):
    flight = hovering(name)
    begin, flight.references[:] = hand(name, flight.state[CHI]), []
    jogged(flight, twist(name, (0.0, 0.06, 0.03), (0.0, 0.0, 0.05)), 2.0)
    moving = hand(name, flight.state[CHI] + 0.01 * flight.state[CHI_DOT])
    np.testing.assert_allclose(
        (moving - hand(name, flight.state[CHI]))[:4] / 0.01, [0.0, 0.06, 0.03, 0.05], atol=4e-3
    )
    flight.step(45)  # the newest message is 0.05 s old; a tick, until it counts
    assert not flight.state[CHI_DOT].any()
    there = hand(name, flight.state[CHI])
    np.testing.assert_allclose(there[4:], begin[4:], atol=1e-3)
    assert there[1] - begin[1] == pytest.approx(0.12, abs=0.03)
    flight.until(lambda output: output.state is State.HOLDING)
    flight.assert_smooth()


@settings(deadline=None, max_examples=60)
@given(
    st.sampled_from(sorted(VEHICLES)),
    st.lists(st.floats(0.02, 0.98), min_size=8, max_size=8),
    st.lists(st.floats(-0.5, 0.5), min_size=8, max_size=8),
    st.booleans(),
)
def test_after_any_jog_the_reference_rests_in_time_and_keeps_its_limits(
    name, shares, asked, of_tool
):
    """At most 5 mm/s and 1 deg/s from 0.3 s after the last message on."""
    p, (low, high) = default_profile("modular", VEHICLES[name]).sets["mission"], ranges(name)
    reference = np.zeros((3, 6 + len(low)))
    reference[CHI, :3] = 0.0, 0.0, 3.0
    reference[CHI, YAW] = 6.28 * shares[3] - 3.14
    reference[CHI, ARM] = low + np.array(shares[4 : 4 + len(low)]) * (high - low)
    asked = np.array(asked)
    try:
        goals = [
            twist(name, linear, (0.0, 0.0, turn), of_tool).solved(reference, p, 0.0)
            for linear, turn in ((asked[:3], asked[3]), (asked[4:7], asked[7]))
        ]
        reference[CHI_DOT] = goals[0].rates  # of the jog before it
        plan = goals[1].plan(0.0, reference, p)
        for part in plan.parts:
            check(part, p, 0.0)
    except PlanRefused:
        assume(False)
    base = plan.at(np.linspace(0.3, plan.end, 50))[CHI_DOT]
    assert np.linalg.norm(base[:, :3], axis=1).max() < 5e-3
    assert np.abs(base[:, YAW]).max() < math.radians(1.0)
    assert plan.end == pytest.approx(0.05 + p.jog_stop)
    assert not plan.at(np.array([plan.end]))[CHI_DOT:].any()


def test_a_jog_is_slowed_down_by_hand_and_base():
    """The S-500's attitude law: 170 / 22.7 = 7.489 rad/s; 5 mm/s (7.489 * 0.25)^2 = 17.5 mm/s."""
    p = default_profile("modular", VEHICLES["s500_arm"]).sets["mission"]
    assert (p.jog_speed, p.jog_stop) == pytest.approx((0.017527, 0.40059), abs=1e-5)
    assert math.degrees(p.jog_turn_rate) == pytest.approx(3.505, abs=1e-3)
    flight = hovering(jog_speed=0.0175, jog_turn_rate=0.5)
    text = flight.mission.plan(twist("s500_arm", (0.0, 0.1, 0.0)))[1]
    assert text == (
        "accepted: slowed down to 0.0175 m/s, 0 rad/s, so that it stops in time; "
        "at the end in 0.5 s"
    )
    # the hand is 0.14 m ahead: the base would move at 0.14 * 0.25 = 35 mm/s
    assert "0 m/s, 0.12 rad/s" in flight.mission.plan(twist("s500_arm", (0,) * 3, (0, 0, 0.25)))[1]
    assert flight.mission.plan(twist("s500_arm", (0, 0.01, 0)))[1].startswith("accepted: at the")


def test_a_jog_is_slowed_down_to_its_limits_and_one_transition():
    flight = hovering()
    before = len(flight.mission.changes)
    jogged(flight, twist("s500_arm", (0.3, 0.4, 0.0)), 1.0)
    np.testing.assert_allclose(flight.state[CHI_DOT, :3], [0.06, 0.08, 0.0], atol=1e-3)
    assert [one.event for one in flight.mission.changes[before:]] == [Event.GOAL]


def test_a_jog_in_the_axes_of_the_tool():
    flight = hovering("t650")
    jogged(flight, twist("t650", (0.1, 0.0, 0.0), of_tool=True), 1.0)
    lifted = hand("t650", flight.state[CHI])[4]
    expected = 0.1 * np.array([math.cos(lifted), 0.0, math.sin(lifted)])
    np.testing.assert_allclose(flight.state[CHI_DOT, :3], expected, atol=2e-3)


def test_a_jog_ends_at_the_limits_of_the_base():
    flight = hovering()
    goal = twist("s500_arm", (0.0, 0.0, -0.1))
    answers = set()
    for _ in range(150):
        accepted, text = flight.mission.plan(goal)
        answers.add(accepted)
        flight.step(5)
        assert flight.state[CHI, 2] > 0.58 - 1e-3  # it is flown a tick of 10 ms after its check
    assert answers == {True, False} and "z is" in text
    flight.assert_smooth()


def test_a_hold_ends_a_jog():
    flight = hovering()
    jogged(flight, twist("s500_arm", (0.1, 0.0, 0.0)), 1.0)
    assert flight.mission.request(OperatorCommand.HOLD)[0]
    flight.step(200)
    assert flight.mission.output.state is State.HOLDING and not flight.state[CHI_DOT].any()


def test_a_jog_of_zeros_ends_a_jog_and_nothing_else():
    flight, still = hovering(), twist("s500_arm", (0.0, 0.0, 0.0))
    before = len(flight.mission.changes)
    assert flight.mission.plan(still) == (True, "accepted: nothing to stop")
    flight.step(10)
    assert len(flight.mission.changes) == before and flight.mission.output.phase != "goal"
    jogged(flight, twist("s500_arm", (0.1, 0.0, 0.0)), 1.0)
    for _ in range(12):
        assert flight.mission.plan(still)[0]
        flight.step(5)
    flight.step(30)
    assert not flight.state[CHI_DOT].any()
    assert flight.mission.plan(still) == (True, "accepted: nothing to stop")
    flight.assert_smooth()


def test_a_goal_keeps_off_the_ends_of_the_joints():
    """There the supervisor holds; the S-500's second joint ends at 2.05 rad."""
    flight = hovering()
    assert flight.mission.plan(pose("s500_arm", 0.3, 0.0, 0.25))[0]
    flight.until(lambda output: output.state is State.HOLDING)
    low, high = flight.limits.joint_ranges
    assert (flight.state[CHI, ARM] >= low + 0.03).all()
    assert (flight.state[CHI, ARM] <= high - 0.03).all()
    room = joint_room(flight.limits)
    np.testing.assert_allclose(room[:, 1], [-2.02, 2.02])
    narrow = joint_room(replace(limits(VEHICLES["s500_arm"]), joint_angle_hold=(0.01, 1.0)))
    np.testing.assert_allclose(narrow, [[0.0, -0.97], [0.0, 0.97]])
