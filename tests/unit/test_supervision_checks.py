"""The quantities that the supervisor checks, and their limits, against hand-worked numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from uam_control.supervision import Observation, Readings, SupervisionParameters
from uam_control.supervision.checks import (
    CHECKS,
    LATE,
    LATE_FOR_REFERENCE,
    LATE_LOOP,
    STILL,
    CheckArrays,
    Checks,
    measure,
    read,
)
from uam_control.supervision.monitor import Level

A, B = math.atan2(0.6, 0.8), math.atan2(0.8, 0.6)  # of the 3-4-5 triangle
BOX = np.array([[-5.0, -6.0, 0.0], [5.0, 6.0, 4.0]])


def limited(values, joints=None, efforts=(), gains=(1.0, 1.0, 1.0)):
    """Arrays of checks with these values and limits."""
    none, joints = np.zeros(0), np.zeros((2, 0)) if joints is None else joints
    return CheckArrays(none, BOX, np.array(gains), joints, np.array(efforts), values, none, none)


def measured(state, reference=None, mocap=(math.nan,) * 3, age=math.nan, ground=0.0, joints=None):
    """What `measure` writes into the first eight values; those behind stay."""
    values = np.full(len(CHECKS), 77.0)
    reference = np.zeros(state.shape) if reference is None else reference
    limits = np.ones(state.shape[1] - 6) if joints is None else np.array(joints)
    limits = np.stack([limits, 0.0 * limits]) if limits.ndim == 1 else limits
    readings = Readings(mocap_position=np.array(mocap), mocap_age=age)
    measure(limited(values, limits), state, reference, ground, readings.arrays)
    np.testing.assert_array_equal(values[9:], 77.0)
    return values[:9]


def test_quantities_of_a_state():
    state, reference = np.zeros((3, 8)), np.zeros((3, 8))
    state[0] = 2.0, -1.0, 3.0, A, -B, 0.7, -1.0, 0.5
    state[1, 3:6] = 0.5, -4.0, 3.0
    reference[0, :6] = 0.0, 1.0, 2.0, 9.0, 9.0, 9.0
    values = measured(state, reference, ground=0.5, joints=[2.0, 2.5])
    # error (2, -2, 1); tilt: cos A cos B = .48; 1 m below the top, 3 m to the nearest wall; yaw
    # 8.3 rad behind: a turn less
    expected = [0.0, 3.0, math.acos(0.48), 4.0, 2.5, -1.0, 0.5, -math.inf, 8.3 - 2.0 * math.pi]
    np.testing.assert_allclose(values, expected)
    # 2 rad below its middle, of 4 rad allowed; 1.5 rad below, of 2.5 rad
    around = [[4.0, 2.5], [1.0, 2.0]]
    assert measured(state, joints=around)[6] == pytest.approx(0.6)
    state[0, 3:5] = math.pi - A, 0.0  # upside down
    assert measured(state)[2] == pytest.approx(math.pi - A)


@pytest.mark.parametrize(("position", "outside"), [
    ((-5.5, 0.0, 1.0), 0.5), ((6.0, 0.0, 1.0), 1.0),
    ((0.0, -6.25, 1.0), 0.25), ((0.0, 8.0, 1.0), 2.0),
    ((0.0, 0.0, -0.5), 0.5), ((0.0, 0.0, 4.75), 0.75),
    ((5.25, 6.5, 1.0), 0.5), ((0.0, 0.0, 1.0), -1.0),
])  # fmt: skip
def test_distance_outside_the_box(position, outside):
    state = np.zeros((3, 8))
    state[0, :3] = position
    assert measured(state)[5] == outside


@pytest.mark.parametrize(("rates", "largest"), [
    ((-3.0, 1.0, 2.0), 3.0), ((1.0, 3.0, 2.0), 3.0), ((1.0, 2.0, -3.0), 3.0), ((0.0, 0.0, 0.5), 0.5)
])  # fmt: skip
def test_the_largest_body_rate(rates, largest):
    state = np.zeros((3, 8))
    state[1, 3:6] = rates
    assert measured(state)[3] == largest


@pytest.mark.parametrize(("age", "pose"), [
    (0.1, (0.0, 0.0, 4.0)),  # where it was 0.1 s ago: (1, 2, 3) - .1 (10, 20, -10)
    (-0.04, (1.4, 2.8, 2.6)),  # where it will be
])  # fmt: skip
def test_distance_of_motion_capture_from_the_estimate_of_its_time(age, pose):
    state = np.zeros((3, 8))
    state[0, :3], state[1, :3] = (1.0, 2.0, 3.0), (10.0, 20.0, -10.0)
    assert measured(state, mocap=pose, age=age)[7] == pytest.approx(0.0, abs=1e-12)
    off = np.array(pose) + [2.0, -1.0, 2.0]
    assert measured(state, mocap=off, age=age)[7] == pytest.approx(3.0)


def test_a_pose_older_than_a_quarter_of_a_second_is_no_distance():
    assert measured(np.zeros((3, 8)), mocap=(9.0, 0.0, 0.0), age=0.26)[7] == -math.inf


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("where", [(0, 0), (1, 5), (2, 8)])
def test_of_a_state_that_is_not_finite_nothing_else_is_said(where, bad):
    state = np.zeros((3, 9))
    state[where] = bad
    values = measured(state)
    assert values[0] == 1.0
    np.testing.assert_array_equal(values[1:], 77.0)


def test_readings_have_their_places():
    values = np.full(len(CHECKS), 77.0)
    readings = Readings(
        battery=0.5, mocap_age=9.0, mocap_still=10.0, joint_age=11.0, controller_age=12.0,
        autopilot_age=13.0, missed_ticks=15.0, temperature=16.0,
        contradiction=19.0, slower=20.0,
        joint_effort=np.array([1.0, -6.0, 2.0]), gains=np.array([3.0, math.nan, 1.0]),
    )  # fmt: skip
    limits = limited(values, efforts=[2.0, 4.0, 8.0], gains=[2.0, 1.0, 0.25])
    read(limits, readings.arrays)
    np.testing.assert_array_equal(values[:9], 77.0)
    # effort: 6/4; gains: 1/.25, the unknown one left out
    np.testing.assert_array_equal(
        values[9:], [-0.5, 9, 10, 11, 12, 13, 77, 15, 16, 1.5, 4.0, 77, 19, 77, 20, 77]
    )


def test_what_is_unknown_is_below_every_limit():
    values = np.zeros(len(CHECKS))
    values[[LATE, LATE_LOOP, LATE_FOR_REFERENCE, STILL]] = -math.inf  # by `Checks.update`
    read(limited(values, efforts=[1.0, 1.0]), Readings().arrays)
    np.testing.assert_array_equal(values[9:], -math.inf)


# not the defaults: a test that judges by them would not notice another limit in their place
AT_ONCE = SupervisionParameters(
    position_error_hold=0.5, position_error_land=2.0, position_error_failsafe=4.0,
    tilt_hold=0.5, tilt_failsafe=1.0, body_rate_hold=2.0, body_rate_failsafe=6.0,
    heading_error_hold=0.625,
    altitude_hold=3.0, geofence_low=(-8.0, -8.0, -8.0), geofence_high=(8.0, 8.0, 8.0),
    geofence_land=0.5, geofence_failsafe=3.0, joint_angle_hold=(1.0, 2.0),
    joint_effort_hold=(2.0, 4.0), temperature_hold=50.0, temperature_land=60.0,
    battery_land=0.25, mocap_age_hold=0.125, mocap_age_failsafe=0.5, mocap_distance_hold=0.25,
    contradiction_failsafe=1.5,
    joint_age_hold=0.375, controller_age_hold=0.625, autopilot_age_land=0.875,
    delay_margin=0.125, delay_nominal=0.0, delay_land=0.5, delay_failsafe=1.5,
    missed_ticks_hold=10.0, missed_ticks_failsafe=20.0, slower_hold=0.375,
    gain_hold=(10.0, 20.0, 30.0),
    hold_after=0.0, land_after=0.0, failsafe_after=0.0, delay_after=0.0,
    clear_after=1.0, hysteresis=0.5,
)  # fmt: skip


def seen(state=(), **readings) -> Observation:
    """A vehicle at rest 1 m high; `state`: pairs of entry and value."""
    found = Observation(np.zeros((3, 8)), np.zeros((3, 8)), 0.0, readings=Readings(**readings))
    found.state[0, 2] = found.reference[0, 2] = 1.0
    for entry, value in state:
        found.state[entry] = value
    return found


def two(a: float, b: float) -> np.ndarray:
    return np.array([a, b])


HOLD, LAND, FAILSAFE = Level.HOLD, Level.LAND, Level.FAILSAFE
LIMITS = [
    ("estimate", FAILSAFE, lambda x: seen([((2, 7), math.inf if x > 0.5 else 0.0)]), 0.5),
    ("position error", HOLD, lambda x: seen([((0, 0), x)]), 0.5),
    ("position error", LAND, lambda x: seen([((0, 1), -x)]), 2.0),
    ("position error", FAILSAFE, lambda x: seen([((0, 0), x)]), 4.0),
    ("tilt", HOLD, lambda x: seen([((0, 3), x)]), 0.5),
    ("tilt", FAILSAFE, lambda x: seen([((0, 4), -x)]), 1.0),
    ("body rate", HOLD, lambda x: seen([((1, 3), x)]), 2.0),
    ("body rate", FAILSAFE, lambda x: seen([((1, 5), -x)]), 6.0),
    ("heading error", HOLD, lambda x: seen([((0, 5), -x)]), 0.625),
    ("joint angle", HOLD, lambda x: seen([((0, 7), -2.0 * x)]), 1.0),
    ("motion capture", HOLD,
     lambda x: seen(mocap_position=np.array([x, 0.0, 1.0]), mocap_age=0.0), 0.25),
    ("mocap", HOLD, lambda x: seen(mocap_age=x), 0.125),
    ("mocap", FAILSAFE, lambda x: seen(mocap_age=x), 0.5),
    ("mocap pose", HOLD, lambda x: seen(mocap_still=x), 0.125),
    ("mocap pose", FAILSAFE, lambda x: seen(mocap_still=x), 0.5),
    ("joint angles", HOLD, lambda x: seen(joint_age=x), 0.375),
    ("controllers", HOLD, lambda x: seen(controller_age=x), 0.625),
    ("autopilot", LAND, lambda x: seen(autopilot_age=x), 0.875),
    ("loop delay", LAND, lambda x: seen(loop_delay=x), 0.0625),
    ("loop delay", FAILSAFE, lambda x: seen(loop_delay=x), 0.1875),
    ("setpoint delay", LAND, lambda x: seen(round_trip=2.0 * x), 0.0625),
    ("control ticks", HOLD, lambda x: seen(missed_ticks=x), 10.0),
    ("control ticks", FAILSAFE, lambda x: seen(missed_ticks=x), 20.0),
    ("servo temperature", HOLD, lambda x: seen(temperature=x), 50.0),
    ("servo temperature", LAND, lambda x: seen(temperature=x), 60.0),
    ("joint torque", HOLD, lambda x: seen(joint_effort=two(-2.0 * x, 0.0)), 1.0),
    ("joint torque", HOLD, lambda x: seen(joint_effort=two(0.0, 4.0 * x)), 1.0),
    ("adapted gain", HOLD, lambda x: seen(gains=np.array([0.0, 0.0, 30.0 * x])), 1.0),
    ("motion capture and IMU", FAILSAFE, lambda x: seen(contradiction=x), 1.5),
    ("battery", LAND, lambda x: seen(battery=-x), -0.25),
    ("simulation", HOLD, lambda x: seen(slower=x), 0.375),
]  # fmt: skip


@pytest.mark.parametrize(("name", "level", "at", "limit"), LIMITS)
def test_a_level_begins_at_its_limit(name, level, at, limit):
    step = 1e-6
    below = Checks(AT_ONCE).update(0.0, at(limit - step), True)
    assert below is None or below.level < level
    checks = Checks(AT_ONCE)
    found = checks.update(0.0, at(limit + step), True)
    assert (found.name, found.level) == (name, level)
    assert checks.finding is found and not checks.quiet


def test_altitude_and_geofence():
    # with the vehicle where its reference is
    def high(z: float, ground: float = 0.0) -> Observation:
        found = seen([((0, 2), z)])
        found.reference[0, 2], found.ground = z, ground
        return found

    assert Checks(AT_ONCE).update(0.0, high(2.99), True) is None
    assert Checks(AT_ONCE).update(0.0, high(1.5, -1.51), True).name == "altitude"
    assert Checks(AT_ONCE).update(0.0, high(1.5, -1.51), False) is None  # not on the ground
    inside = replace(AT_ONCE, altitude_hold=1000.0)
    assert Checks(inside).update(0.0, high(8.49), True) is None
    found = Checks(inside).update(0.0, high(8.51), True)
    assert found == (LAND, "geofence left by 0.51 m, 0.5 m allowed", "geofence")
    found = Checks(inside).update(0.0, high(11.01), True)
    assert found == (FAILSAFE, "geofence left by 3.01 m, 3 m allowed", "geofence")


def test_motion_capture_off_the_estimate_is_a_hold_and_a_failsafe_as_late_as_no_pose():
    off = seen(mocap_position=np.array([0.0, 0.5, 1.0]), mocap_age=0.0)
    checks = Checks(AT_ONCE)
    cause = "motion capture is 0.50 m off the estimate, 0.25 m allowed"
    assert checks.update(0.0, off, True) == (HOLD, cause, "motion capture")
    assert checks.update(0.25, off, True)[0] is HOLD
    assert checks.update(0.5, off, True) == (FAILSAFE, cause, "motion capture")


@pytest.mark.parametrize(("times", "level", "at", "beyond"), [
    ((0.5, 0.0, 0.0), HOLD, "tilt", 0.75),
    ((0.0, 0.5, 0.0), LAND, "position error", 3.0),
    ((0.0, 0.0, 0.5), FAILSAFE, "tilt", 1.5),
])  # fmt: skip
def test_a_limit_must_be_exceeded_for_the_time_of_its_level(times, level, at, beyond):
    hold, land, failsafe = times
    checks = Checks(replace(AT_ONCE, hold_after=hold, land_after=land, failsafe_after=failsafe))
    look = seen([((0, 3) if at == "tilt" else (0, 0), beyond)])
    early = checks.update(0.0, look, True)
    assert early is None or early.level < level
    assert not checks.quiet  # a limit is exceeded, if not yet for long enough
    assert checks.update(0.5, look, True)[::2] == (level, at)


@pytest.mark.parametrize(("beyond", "level"), [(0.1, LAND), (0.2, FAILSAFE)])
def test_a_measured_delay_needs_evidence_without_a_gap(beyond, level):
    checks = Checks(replace(AT_ONCE, delay_after=1.0))
    late, unknown = seen(loop_delay=beyond), seen()
    assert checks.update(0.0, late, True) is None
    assert checks.update(0.9, late, True) is None
    assert checks.update(0.95, unknown, True) is None
    assert checks.update(1.0, late, True) is None  # it begins anew
    assert checks.update(1.99, late, True) is None
    assert checks.update(2.0, late, True)[::2] == (level, "loop delay")
    # the round trip is no fit: it counts at once
    assert Checks(replace(AT_ONCE, delay_after=1.0)).update(
        0.0, seen(round_trip=2.0 * beyond), True
    )[::2] == (level, "setpoint delay")


@pytest.mark.parametrize("late", [{"loop_delay": 0.051}, {"round_trip": 0.102}])
def test_a_delay_that_the_reference_does_not_stand_holds(late):
    checks = Checks(AT_ONCE)
    assert checks.update(0.0, seen(**late), True) is None  # of any reference 62.5 ms are allowed
    checks.follow(0.05)
    cause = "setpoint delay 0.051 s exceeds 0.05 s that the reference stands"
    assert checks.update(0.0, seen(**late), True) == (HOLD, cause, "delay for the reference")


def test_before_the_start_the_whole_round_trip_counts_for_the_reference():
    checks = Checks(AT_ONCE)
    assert "delay for the reference" not in {check.name for check, _, _ in checks.on_ground()}
    checks.follow(0.05)
    checks.update(0.0, seen(round_trip=0.06), False)
    (found,) = [row[1:] for row in checks.on_ground() if row[0].name == "delay for the reference"]
    assert found == (0.06, 0.05)


def test_a_measured_delay_counts_in_flight_only():
    assert Checks(AT_ONCE).update(0.0, seen(loop_delay=1.0), False) is None


def test_what_means_nothing_on_the_ground_is_not_in_the_report_before_arming():
    names = {check.name for check, _, _ in Checks(AT_ONCE).on_ground()}
    left_out = {"position error", "altitude", "motion capture", "mocap pose", "loop delay"}
    assert not names & left_out and {"tilt", "battery", "setpoint delay"} < names


@pytest.mark.parametrize("look", [
    seen([((0, 0), 0.75)]),
    seen(mocap_position=np.array([0.0, 0.5, 1.0]), mocap_age=0.0),
    seen(mocap_still=0.25),
])  # fmt: skip
def test_some_quantities_mean_nothing_on_the_ground(look):
    assert Checks(AT_ONCE).update(0.0, look, False) is None
    assert Checks(AT_ONCE).update(0.0, look, True).level is HOLD


@pytest.mark.parametrize("look", [
    seen([((0, 3), 0.75)]), seen([((1, 3), 3.0)]), seen([((0, 6), 1.5)]), seen(battery=0.1),
    seen(mocap_age=0.25), seen(joint_age=0.5), seen(controller_age=0.75), seen(autopilot_age=1.0),
    seen(round_trip=0.125), seen(missed_ticks=15.0), seen(temperature=55.0),
    seen(joint_effort=two(3.0, 0.0)), seen(gains=np.array([15.0, 0.0, 0.0])),
])  # fmt: skip
def test_the_others_count_there_too(look):
    assert Checks(AT_ONCE).update(0.0, look, False).level is not Level.FINE


def test_the_worst_counts_and_of_equals_the_first():
    both = seen([((0, 3), 0.75)], battery=0.1, temperature=65.0)
    found = Checks(AT_ONCE).update(0.0, both, True)
    assert found == (LAND, "battery 0.10 full, below 0.25", "battery")
    equals = seen([((0, 3), 0.75), ((1, 3), 3.0)])
    assert Checks(AT_ONCE).update(0.0, equals, True) == (
        HOLD, "tilt 0.75 rad exceeds 0.5 rad", "tilt",
    )  # fmt: skip
    worse_first = seen([((0, 3), 1.5), ((1, 3), 3.0)])
    assert Checks(AT_ONCE).update(0.0, worse_first, True).name == "tilt"


def test_a_value_is_clear_when_it_is_below_the_limit_by_the_hysteresis_for_long_enough():
    checks, tilted = Checks(AT_ONCE), [seen([((0, 3), tilt)]) for tilt in (0.75, 0.3, 0.2)]
    assert checks.quiet and checks.finding is None
    assert checks.update(0.0, tilted[0], True).level is HOLD
    assert checks.update(1.0, tilted[1], True).level is HOLD  # 0.5 less half of it is 0.25
    assert checks.update(3.0, tilted[1], True).level is HOLD
    assert checks.update(4.0, tilted[2], True).level is HOLD
    assert checks.update(4.75, tilted[2], True).level is HOLD
    assert checks.update(5.0, tilted[2], True) is None
    assert checks.quiet and checks.finding is None


def test_the_cause_has_the_largest_value_since_the_limit_was_exceeded():
    # beyond the limit for one tick, then within it by less than the hysteresis until hold_after
    checks = Checks(replace(AT_ONCE, hold_after=1.0))
    for stamp, tilt in ((0.0, 0.75), (0.5, 0.3)):
        assert checks.update(stamp, seen([((0, 3), tilt)]), True) is None
    found = checks.update(1.0, seen([((0, 3), 0.3)]), True)
    assert found == (HOLD, "tilt 0.75 rad exceeds 0.5 rad", "tilt")
    # a second excess has its own largest value
    checks.update(2.0, seen([((0, 3), 0.1)]), True)
    checks.update(2.5, seen([((0, 3), 0.6)]), True)
    assert checks.update(3.5, seen([((0, 3), 0.4)]), True).cause == "tilt 0.60 rad exceeds 0.5 rad"


def test_the_battery_is_clear_when_it_is_above_its_limit_by_the_hysteresis():
    checks = Checks(AT_ONCE)
    assert checks.update(0.0, seen(battery=0.2), True).level is LAND
    for stamp, battery in ((1.0, 0.36), (3.0, 0.36), (4.0, 0.38), (4.75, 0.38)):
        assert checks.update(stamp, seen(battery=battery), True).level is LAND
    assert checks.update(5.0, seen(battery=0.38), True) is None


def test_other_limits_are_those_of_the_next_tick():
    checks = Checks(AT_ONCE)
    checks.configure(replace(AT_ONCE, tilt_hold=0.9))
    assert checks.update(0.0, seen([((0, 3), 0.75)]), True) is None
    assert checks.update(0.0, seen([((0, 3), 0.95)]), True).name == "tilt"


def test_every_quantity_is_named_once():
    assert len({check.name for check in CHECKS}) == len(CHECKS) == 25
