"""The table of ages: its order, and that every consumer has its number."""

from __future__ import annotations

from uam_control import ages
from uam_control.estimation import pose_filter
from uam_control.estimation.pose_clock import counts, new_clock
from uam_control.grasp.grasp_parameters import GraspParameters
from uam_control.offboard.sequence import LINK_GAP
from uam_control.setpoints.level_hold import HoldParameters
from uam_control.stages.autopilot_port import REPORT_PERIOD
from uam_control.supervision.supervision_parameters import SupervisionParameters
from uam_control.vehicle.loading import LONGEST_PERIOD
from uam_sim_bridge.autopilot import autopilot_estimator
from uam_sim_bridge.autopilot.commander import STREAM_GAP

PERIOD = 0.004  # [s]


def test_the_order_of_the_ages_makes_sense():
    # a pose that the autopilot no longer gets holds the vehicle; while it holds and lands, the
    # estimate uses poses up to the age at which they are missing for everyone: then failsafe
    assert ages.AHEAD_FOR < ages.AHEAD  # before a pose that is so far ahead would be used
    assert ages.AHEAD < ages.STALE < ages.FORWARDED <= ages.HOLD < ages.UNAIDED < ages.BRIDGED
    assert ages.BRIDGED == ages.FAILSAFE < ages.DISCONNECTED < ages.OTHER_CLOCK
    assert ages.HOLD < ages.LAND < ages.FAILSAFE
    # the estimate does not follow wrong poses until a failsafe is on the ground (from 3 m)
    blind = ages.FAILSAFE + SupervisionParameters().blind_time
    assert blind + 3.0 / 0.7 < ages.REJECTED <= ages.OTHER_CLOCK
    # a stream that is lost is seen here before the autopilot leaves OFFBOARD by itself
    assert 2e-9 * REPORT_PERIOD < ages.SILENT < ages.LAND  # one lost report is no silence
    assert ages.STALE < LINK_GAP < STREAM_GAP <= HoldParameters().release_time


def test_every_consumer_has_the_number_of_the_table():
    limits = SupervisionParameters()
    assert limits.mocap_age_hold == limits.joint_age_hold == limits.controller_age_hold == ages.HOLD
    assert limits.mocap_age_failsafe == ages.FAILSAFE and limits.autopilot_age_land == ages.LAND
    assert GraspParameters().payload_age == ages.FORWARDED
    # the rings reach back as far as poses are used, with one row more at either end
    assert pose_filter.HISTORY * PERIOD > ages.BRIDGED + 2 * PERIOD
    assert autopilot_estimator.HISTORY * PERIOD > ages.FORWARDED + PERIOD
    assert ages.FORWARDED > 2.0 * LONGEST_PERIOD


def test_usable_up_to_an_age_and_a_little_ahead():
    found = [ages.usable(age, 0.25) for age in (-0.06, -0.05, 0.0, 0.25, 0.26, float("nan"))]
    assert found == [False, True, True, True, False, False]


def test_poses_of_a_clock_that_jumped_back_do_not_count():
    clock, latency = new_clock(), 0.01
    seen = [counts(clock, now - latency, now, ages.BRIDGED) for now in (5.0, 5.01, 5.02)]
    behind = [
        counts(clock, now - latency - 0.2, now, ages.BRIDGED) for now in (5.03, 5.13, 5.33, 5.53)
    ]
    again = [counts(clock, now - latency, now, ages.BRIDGED) for now in (5.54, 5.55)]
    assert (seen, behind, again) == ([True] * 3, [False] * 4, [True] * 2)


def test_poses_that_come_late_count_and_so_do_single_ones_after_an_older_one():
    clock = new_clock()
    # (stamp, arrival): a network that is 0.2 s late from 5.0 s on, and then fast again
    late = [(4.99, 5.0), (5.0, 5.2), (5.01, 5.21), (5.3, 5.31)]
    assert all(counts(clock, stamp, now, ages.BRIDGED) for stamp, now in late)
    # one message overtakes another
    assert counts(clock, 5.33, 5.34, ages.BRIDGED) and counts(clock, 5.32, 5.34, ages.BRIDGED)
    assert not counts(clock, 5.2, 5.35, ages.BRIDGED) and counts(clock, 5.34, 5.35, ages.BRIDGED)
