"""The executive of grasp and release against a payload on a stand, in steps of 20 ms."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from uam_control.coordinates import MOTION_ROWS
from uam_control.grasp import Grasp, GraspExecutive, GraspParameters, Sight, grasp_windows
from uam_control.grasp.alignment import Alignment
from uam_control.grasp.evidence import (
    Load,
    by_mass,
    by_pose,
    by_travel,
    expected_throttle,
    identified_mass,
)
from uam_control.grasp.sight import PlaceHistory, RunningMean, hand_and_levers
from uam_control.mission import load_scenario
from uam_control.vehicle import chain_of, load_description

P = GraspParameters()
ARM = chain_of(load_description())
PLACE = np.array([-0.789, 0.0, 0.7675])
STEP = 0.02


def test_the_window_of_the_papers_mission():
    scenario = load_scenario("pick_and_place")
    (window,) = grasp_windows(scenario.moves, scenario.magnet)
    assert window[:5] == (30.0, 35.0, 37.5, 70.0, 71.0)
    assert window.back == pytest.approx((0.0, 0.0, 0.06))


@pytest.mark.parametrize("name", ["hover", "arm_motions"])
def test_a_flight_without_magnet_has_no_window(name):
    scenario = load_scenario(name)
    assert grasp_windows(scenario.moves, scenario.magnet) == ()


def test_magnet_position_by_hand():
    """(45, 45) deg: 0.1 sin 45 + 0.14 forward, 0.1 cos 45 down; the face hangs 0.03 below."""
    chi = np.array([-1.0, 0.0, 0.94, 0.0, 0.0, 0.0, math.pi / 4, math.pi / 4])
    at, levers = hand_and_levers(ARM, chi)
    down = 0.1 * math.sqrt(0.5)
    assert at == pytest.approx([-1.0 + down + 0.14, 0.0, 0.94 - 0.073 - down - 0.03])
    assert levers == pytest.approx([down + 0.14, 0.14])
    chi[5] = math.pi / 2  # heading north: the arm points along y
    at, _ = hand_and_levers(ARM, chi)
    assert at[:2] == pytest.approx([-1.0, down + 0.14])


def test_force_and_torque_identify_the_mass():
    before, lever_arm = Load(21.6, 0.5), 0.2
    now = Load(21.6 + 0.2 * 9.81, 0.5 + 0.2 * 9.81 * lever_arm)
    assert identified_mass(before, now, lever_arm) == pytest.approx(0.2)
    assert identified_mass(before, Load(now.lift), lever_arm) == pytest.approx(0.2)
    assert math.isnan(identified_mass(Load(), Load(), lever_arm))


@pytest.mark.parametrize(
    ("mass", "expected", "held"),
    [(0.2, 0.2, True), (0.01, 0.2, False), (0.01, 0.05, None), (math.nan, 0.2, None)],
)
def test_a_payload_that_may_be_lighter_than_the_limit_has_no_verdict(mass, expected, held):
    assert by_mass(mass, expected, P).held is held


@pytest.mark.parametrize(
    ("travel", "moved", "held"),
    [
        ((0.0, 0.0, 0.06), (0.0, 0.0, 0.06), True),
        ((0.0, 0.0, 0.06), (0.0, 0.0, 0.04), True),
        ((0.0, 0.0, 0.04), (0.0, 0.0, 0.0), None),
        ((0.0, 0.0, 0.06), (0.0, 0.0, 0.0), False),
        ((0.12, 0.0, 0.008), (0.12, 0.0, 0.008), True),  # the arm turns during the climb
        ((0.12, 0.0, -0.06), (0.12, 0.0, -0.06), True),
        ((0.12, 0.0, -0.06), (0.0, 0.0, 0.0), False),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), None),
        ((0.0, 0.0, 0.06), (0.0, 0.0, math.nan), None),
    ],
)
def test_the_pose_decides_by_distance_and_travel_in_any_direction(travel, moved, held):
    sight = Sight(0.0, 37.0, PLACE + travel, payload=PLACE + moved)
    assert by_travel(sight, PLACE, PLACE, P).held is held


@pytest.mark.parametrize("name", ["pick_and_place", "quick_pick"])
def test_a_payload_at_the_magnet_is_held_at_once_in_every_scenario(name):
    flight = Flight(lambda attempt: True, scenario=name)
    (window,) = flight.windows
    assert flight.until(window.release + 2.0) == [Grasp.APPROACHED, Grasp.HELD, Grasp.RELEASED]
    descent, held = flight.executive.decisions[:2]
    assert held.stamp - descent.stamp <= window.lifted - window.descent + 0.1
    assert "payload moved" in held.text


@pytest.mark.parametrize("name", ["pick_and_place", "quick_pick"])
def test_a_payload_that_stays_is_given_up_in_every_scenario(name):
    flight = Flight(lambda attempt: False, scenario=name)
    assert flight.until(flight.windows[0].release)[-1] is Grasp.GIVEN_UP


def test_the_weight_decides_if_the_place_before_the_grasp_is_unknown():
    flight = Flight(lambda attempt: True, tracked=False)
    flight.until(36.0)
    flight.tracked = True
    assert flight.until()[1:] == [Grasp.HELD, Grasp.RELEASED]


def test_a_running_mean_has_the_mean_and_the_deviation_of_its_values():
    mean, random = RunningMean(), np.random.default_rng(1)
    for k in range(2000):
        mean.add(STEP * k, np.array([1.0, random.normal(0.0, 0.5)]))
    assert mean.mean == pytest.approx([1.0, 0.0], abs=0.3)
    assert mean.deviation == pytest.approx([0.0, 0.5], abs=0.2)
    mean.add(40.0, np.array([math.nan, 0.0]))
    assert mean.span(41.0) == -math.inf


def test_a_fast_payload_is_compared_with_the_magnet_of_its_poses_stamp():
    """At 5 m/s a pose that is 100 ms old lies 0.5 m behind the tool."""
    places, velocity = PlaceHistory(), np.array([5.0, 0.0, 0.0])
    for k in range(1000):  # the ring is written over
        places.add(STEP * k, PLACE + velocity * STEP * k)
    now, seen = STEP * 999, STEP * 999 - 0.107
    carried = PLACE + velocity * seen
    sight = Sight(now, 50.0, PLACE + velocity * now, payload=carried, tool_then=places.at(seen))
    assert by_pose(sight, P).text == "payload 0 mm from the tool"
    begin = PLACE + velocity * STEP * 900
    assert by_travel(sight, begin, begin, P).held
    sight.payload = PLACE  # it stayed where it was
    assert by_travel(sight, begin, begin, P).held is False


def test_places_between_beside_and_outside_the_known_ones():
    places = PlaceHistory()
    assert np.isnan(places.at(1.0)).all()
    places.add(1.0, np.zeros(3))
    assert places.at(1.0) == pytest.approx(np.zeros(3)) and np.isnan(places.at(1.01)).all()
    places.add(1.02, np.array([0.2, 0.0, 0.0]))
    assert places.at(1.005) == pytest.approx([0.05, 0.0, 0.0])
    assert places.at(1.024) == pytest.approx([0.24, 0.0, 0.0])  # a pose newer than the state
    for unknown in (0.99, 1.2, math.nan):
        assert np.isnan(places.at(unknown)).all()
    places.add(0.5, np.ones(3))  # time went back
    assert np.isnan(places.at(1.0)).all() and places.at(0.5) == pytest.approx(np.ones(3))


def test_a_pose_of_an_unknown_place_has_no_verdict():
    sight = Sight(1.0, 50.0, PLACE, payload=PLACE + [0.5, 0.0, 0.0])
    assert by_pose(sight, P).held is False
    sight.tool_then = np.full(3, math.nan)
    assert by_pose(sight, P).held is None
    assert by_travel(sight, PLACE, PLACE, P).held is None


class Flight:
    """A vehicle that follows the mission's path exactly, and a payload on its stand.

    grips(attempt) -> whether the tool takes the payload; shift: of the payload on its stand.
    """

    def __init__(
        self,
        grips,
        offset=(0.0, 0.0),
        tracked=True,
        mass=0.2,
        scenario="pick_and_place",
        **parameters,
    ):
        scenario = load_scenario(scenario)
        self.windows = grasp_windows(scenario.moves, scenario.magnet)
        self.path = scenario.trajectory(np.array([0.0, 0.0, 0.28, 0.0, 0.0, 0.0, 0.0, 1.57]))
        self.scenario, self.grips, self.mass = scenario, grips, mass
        self.executive = GraspExecutive(
            self.windows, mass, dataclasses.replace(P, **parameters).validated(2)
        )
        self.time = self.windows[0].descent - 2.0
        self.stamp, self.shift = 100.0 + self.time, np.zeros(3)
        self.payload = PLACE + [*offset, 0.0]
        self.tracked, self.carried, self.taken = tracked, False, True
        self.noise = lambda: np.zeros(3)
        self.error = np.zeros(3)
        self.gust = lambda time: 0.0  # [N]
        self.throttle = lambda: 0.6

    def tool(self):
        return self.planned(self.time) + self.shift + self.error + self.noise()

    def planned(self, time):
        """The tool on the path of the scenario."""
        motion = np.zeros((MOTION_ROWS, 8))
        self.path.write(time, motion)
        return hand_and_levers(ARM, motion[0])[0]

    def attempt(self):
        decisions = self.executive.decisions
        return decisions[-1].attempt if decisions else 0

    def step(self):
        on = self.scenario.magnet_on(self.time) or self.executive.directive.grip
        tool = self.tool()
        near = np.linalg.norm(tool - self.payload) < 0.01
        if on and not self.carried and near and self.grips(self.attempt()):
            self.carried = True
        if self.carried and on:
            self.payload = tool.copy()
        elif self.carried:
            self.carried, self.payload[2] = False, 0.05
        payload = self.payload if self.tracked else np.full(3, np.nan)
        load = self.mass * 9.81 * self.carried
        window = self.executive.aligns_for
        ahead = self.planned(window.descent) - self.planned(self.time) if window else np.zeros(3)
        directive = self.executive.step(
            Sight(
                self.stamp,
                self.time,
                tool,
                error=self.error.copy(),
                payload=payload.copy(),
                lift=21.6 + load + self.gust(self.stamp),
                throttle=self.throttle(),
                effort=0.5 + 0.2 * load,
                lever=0.2,
                ahead=ahead,
            )
        )
        self.shift = self.shift + 0.05 * (directive.shift - self.shift)
        self.time += STEP * directive.pace
        self.stamp += STEP
        return directive

    def until(self, time=75.0, limit=400.0):
        begin = self.stamp
        while self.time < time:
            self.step()
            assert self.stamp - begin < limit, self.executive.decisions
        return [decision.grasp for decision in self.executive.decisions]


def test_a_good_grasp_costs_no_time():
    flight = Flight(lambda attempt: True)
    assert flight.until() == [Grasp.APPROACHED, Grasp.HELD, Grasp.RELEASED]
    assert flight.stamp - 128.0 == pytest.approx(75.0 - 28.0, abs=2 * STEP)
    assert not flight.executive.directive.shift.any()


def test_a_payload_beside_its_place_is_met():
    flight = Flight(lambda attempt: True, offset=(0.015, -0.01))
    assert flight.until(36.0)[-1] is Grasp.APPROACHED
    assert np.hypot(*(flight.tool() - flight.payload)[:2]) < 0.003
    assert flight.until()[-1] is Grasp.RELEASED


@pytest.mark.parametrize("shifting", [False, True])
def test_a_correction_waits_for_the_last_one(shifting):
    """On its way the path is not where the last correction leads: twice would be too far."""
    scenario, alignment = load_scenario("pick_and_place"), Alignment()
    (window,) = grasp_windows(scenario.moves, scenario.magnet)
    for k in range(300):
        tool = np.array([0.0, 0.0, 0.1])
        sight = Sight(0.01 * k, 0.0, tool, payload=np.zeros(3), shifting=shifting)
        alignment.add(sight, window)
    shift = np.zeros(3)
    assert (alignment.correction(shift, P) is shift) == shifting


def test_a_missed_payload_is_approached_again():
    flight = Flight(lambda attempt: attempt == 2)
    assert flight.until()[-2:] == [Grasp.HELD, Grasp.RELEASED]
    assert flight.executive.decisions[-1].attempt == 2


def test_after_the_allowed_approaches_it_is_given_up_where_it_is():
    flight = Flight(lambda attempt: False)
    assert flight.until()[-1] is Grasp.GIVEN_UP
    last = flight.executive.decisions[-1]
    assert last.text == "given up, 3 approaches; payload at (-0.79, 0.00, 0.77) m"
    assert last.attempt == 3
    assert flight.executive.directive.without_descent == flight.windows[0]


def test_a_payload_that_has_fallen_is_not_approached_again():
    flight = Flight(lambda attempt: False)
    flight.until(33.0)
    flight.payload = np.array([-0.6, 0.1, 0.04])
    assert flight.until()[-1] is Grasp.GIVEN_UP
    assert "fallen from its place; payload at (-0.60, 0.10, 0.04) m" in (
        flight.executive.decisions[-1].text
    )
    assert flight.executive.decisions[-1].attempt == 1


@pytest.mark.parametrize("period", [0.3, 0.4, 0.6])
def test_a_payload_that_is_seen_at_times_only_is_not_waited_for_without_end(period):
    flight = Flight(lambda attempt: True, offset=(0.03, 0.0))
    while flight.executive.grasp is Grasp.NONE:
        flight.tracked = flight.stamp % period < 0.5 * period
        flight.step()
        assert flight.stamp < 128.0 + 2.0 + 3.0 * P.align_timeout
    assert flight.executive.decisions[0].text == "no descent, payload seen at times only"


def test_given_up_may_land():
    flight = Flight(lambda attempt: False, grasp_given_up="land", grasp_attempts=1)
    while not flight.step().land:
        assert flight.stamp < 300.0
    assert flight.executive.directive.land.startswith("given up, 1 approaches")


@pytest.mark.parametrize("where", [(5.0, 5.0, 0.04), (-0.75, 0.0, 0.04)])
def test_an_absent_payload_costs_no_time(where):
    """Far away, or on the floor below its place."""
    flight = Flight(lambda attempt: False)
    flight.payload = np.array(where)
    assert flight.until() == [Grasp.ABSENT]
    assert flight.executive.directive.without_descent == flight.windows[0]
    assert flight.stamp - 128.0 == pytest.approx(75.0 - 28.0, abs=2 * STEP)


def test_an_absent_payload_may_land():
    flight = Flight(lambda attempt: False, grasp_given_up="land")
    flight.payload = np.array([5.0, 5.0, 0.04])
    while not flight.step().land:
        assert flight.stamp < 140.0
    text = "absent, not within 0.08 m of its place; payload at (5.00, 5.00, 0.04) m"
    assert flight.executive.directive.land == text


@pytest.mark.parametrize("error", [0.0, 0.1])
def test_a_vehicle_that_arrives_late_does_not_take_its_payload_for_absent(error):
    """The path ends where the descent begins, and a gust holds the vehicle off: both pass."""
    flight = Flight(lambda attempt: True, scenario="quick_pick")
    flight.error = np.array([error, 0.0, 0.0])
    while flight.stamp < 100.0 + flight.windows[0].descent + 1.0:
        flight.step()
    assert flight.executive.grasp is (Grasp.NONE if error else Grasp.APPROACHED)
    assert np.max(np.abs(flight.executive.directive.shift[:2])) < 1e-3
    flight.error[:] = 0.0
    assert flight.until(flight.windows[0].release + 2.0)[-2:] == [Grasp.HELD, Grasp.RELEASED]


def test_a_payload_just_out_of_reach_is_looked_at_twice():
    flight = Flight(lambda attempt: True, offset=(0.1, 0.0))
    begin = 100.0 + flight.windows[0].descent
    while flight.executive.grasp is Grasp.NONE:
        flight.step()
    assert flight.executive.grasp is Grasp.ABSENT
    assert 2.0 <= flight.stamp - begin < 2.2
    flight = Flight(lambda attempt: True, offset=(0.1, 0.0))
    while flight.stamp < begin + 1.0:
        flight.step()
    flight.payload = PLACE.copy()  # somebody has put it right
    assert flight.until()[-2:] == [Grasp.HELD, Grasp.RELEASED]


def test_without_mocap_of_the_payload_the_mass_decides():
    flight = Flight(lambda attempt: True, tracked=False)
    assert flight.until() == [Grasp.APPROACHED, Grasp.HELD, Grasp.RELEASED]
    assert "identified mass 0.20 kg" in flight.executive.decisions[1].text
    flight = Flight(lambda attempt: False, tracked=False)
    assert flight.until()[-1] is Grasp.GIVEN_UP


def test_a_gust_is_no_payload():
    flight = Flight(lambda attempt: False, tracked=False)
    waiting = 100.0 + flight.windows[0].lifted + 1.0
    flight.gust = lambda stamp: 2.5 if waiting < stamp < waiting + 0.3 else 0.0
    assert Grasp.HELD not in flight.until()


def test_a_light_payload_without_mocap_is_carried_unverified():
    flight = Flight(lambda attempt: True, tracked=False, mass=0.03)
    assert Grasp.UNVERIFIED in flight.until()


def test_a_lost_payload_is_noticed_and_located():
    flight = Flight(lambda attempt: True)
    flight.until(50.0)
    flight.carried, flight.grips = False, lambda attempt: False
    flight.payload = np.array([0.1, 0.0, 0.04])
    flight.until(50.5)
    last = flight.executive.decisions[-1]
    assert last.grasp is Grasp.LOST and "(0.10, 0.00, 0.04) m" in last.text


def test_it_looks_less_often_where_it_has_nothing_to_decide():
    flight = Flight(lambda attempt: True)
    flight.until(33.0)
    assert flight.executive.period == pytest.approx(0.02)
    flight.until(55.0)
    assert flight.executive.period == pytest.approx(0.1)
    flight.until(flight.windows[0].release)
    assert flight.executive.period == pytest.approx(0.02)


def test_a_contact_is_left_upwards():
    flight = Flight(lambda attempt: False)
    flight.until(36.0)
    flight.error = np.array([0.12, 0.0, 0.0])
    for _ in range(20):
        directive = flight.step()
    assert directive.pace == 0.0 and directive.shift[2] == pytest.approx(P.contact_climb)
    assert "contact near the stand" in flight.executive.decisions[-1].text
    flight.error[:] = 0.0
    for _ in range(40):
        directive = flight.step()
    assert directive.pace == -1.0


def test_a_restless_vehicle_does_not_descend():
    flight = Flight(lambda attempt: True)
    flight.noise = lambda: 0.03 * np.sin(9.0 * flight.stamp) * np.array([1.0, 1.0, 0.0])
    decisions = flight.until()
    assert decisions[-1] is Grasp.GIVEN_UP
    assert all("no descent" in one.text for one in flight.executive.decisions[:-1])


def test_time_in_which_the_scenario_is_not_flown_does_not_count_as_waiting():
    """Twice align_timeout of interruption, then half of it restless: no approach is lost."""
    flight = Flight(lambda attempt: True)
    flight.noise = lambda: 0.03 * np.sin(9.0 * flight.stamp) * np.array([1.0, 1.0, 0.0])
    while flight.executive.directive.pace:
        flight.step()
    for _ in range(round(2.0 * P.align_timeout / STEP)):
        flight.executive.interrupt()
        flight.stamp += STEP
    for _ in range(round(0.5 * P.align_timeout / STEP)):
        flight.step()
    assert flight.executive.decisions == []
    flight.noise = lambda: np.zeros(3)
    assert flight.until() == [Grasp.APPROACHED, Grasp.HELD, Grasp.RELEASED]


def test_the_thrust_with_a_payload_is_expected_from_its_weight():
    """2 kg hover with 0.6; 0.4 kg more: 0.6 * 2.4 / 2."""
    sight = Sight(0.0, 0.0, PLACE, lift=2.0 * 9.81, throttle=0.6)
    assert expected_throttle(sight, 0.4) == pytest.approx(0.72)
    assert math.isnan(expected_throttle(Sight(0.0, 0.0, PLACE, throttle=0.6), 0.4))


def test_a_payload_that_is_too_heavy_for_the_thrust_is_not_picked():
    """21.6 N with 0.84; 0.2 kg more: 0.84 (1 + 0.2 * 9.81 / 21.6) = 0.92 > 0.9."""
    flight = Flight(lambda attempt: True)
    flight.throttle = lambda: 0.84
    assert flight.until() == [Grasp.GIVEN_UP]
    assert flight.executive.decisions[-1].text == "given up, too heavy: thrust 0.92 with 0.2 kg"
    assert flight.executive.directive.without_descent == flight.windows[0]
    light = Flight(lambda attempt: True, mass=0.1)
    light.throttle = lambda: 0.84  # 0.88
    assert light.until()[-1] is Grasp.RELEASED


@pytest.mark.parametrize("heavy_until", [37.6, 38.0])
def test_a_payload_that_takes_all_thrust_is_set_down_on_its_stand(heavy_until):
    """While it is lifted, or a moment later, at most 5 cm beside: 0.3 s of full thrust."""
    flight = Flight(lambda attempt: True, offset=(0.015, -0.01))
    flight.throttle = lambda: 1.0 if flight.carried and flight.time > heavy_until - 1.0 else 0.6
    stood = flight.payload.copy()
    assert flight.until()[-2:] == [Grasp.APPROACHED, Grasp.GIVEN_UP]
    texts = [one.text for one in flight.executive.decisions]
    assert texts[-2] == "too heavy, thrust 1.00: set down"
    assert texts[-1].startswith("given up, too heavy")
    assert flight.executive.decisions[-1].attempt == 1
    assert np.hypot(*(flight.payload - stood)[:2]) < 0.005
    assert not flight.executive.directive.land


@pytest.mark.parametrize(("sunk", "lands"), [(0.07, False), (0.09, True)])
def test_a_vehicle_that_sinks_on_its_way_lands_with_the_payload(sunk, lands):
    flight = Flight(lambda attempt: True)
    flight.until(60.0)
    flight.throttle, flight.error = lambda: 0.95, np.array([0.0, 0.0, -sunk])
    flight.until(61.0)
    text = "too heavy, thrust 0.95: lands"
    assert flight.executive.directive.land == (text if lands else "")
    assert flight.executive.grasp is Grasp.HELD


def test_a_moment_of_full_thrust_is_no_shortage():
    flight = Flight(lambda attempt: True)
    flight.throttle = lambda: 1.0 if flight.carried and flight.stamp % 1.0 < 0.29 else 0.6
    assert flight.until() == [Grasp.APPROACHED, Grasp.HELD, Grasp.RELEASED]
