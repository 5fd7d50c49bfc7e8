"""The thrust factor: it converges, keeps to its bounds, and is held without information."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.setpoints.rate_thrust_map import RateThrustMap
from uam_control.setpoints.thrust_curve import thrust_of_command
from uam_control.setpoints.thrust_identification import (
    ThrustIdentification,
    ThrustIdentificationParameters,
    identify,
)
from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import load_description

DT = 0.004
MASS, GRAVITY = 2.2, 9.81
FULL = 4 * 10.34


class Identification(ThrustIdentification):
    """Ticks in the order of the bridge: the magnet's states, then the factor."""

    @property
    def factor(self):
        return float(self.memory[0].factor)

    def update(self, time, state, command, assumed, flying):
        self.follow_magnet(time, math.isfinite(time + assumed + command))
        return identify(time, state, command, assumed, flying, self.record, self.memory)


class Hover:
    """A vehicle whose motors give `truth` of the assumed thrust, under a perfect position law."""

    def __init__(self, truth=0.85, noise=0.0, **parameters):
        given = ThrustIdentificationParameters.of(load_description(), parameters)
        self.identification = Identification(given)
        self.truth, self.noise = truth, noise
        self.random = np.random.default_rng(3)
        self.state = np.zeros((3, 8))
        self.hanging = 0.0
        self.time = 0.0
        self.fly(0.1, flying=False)
        self.state[0, 2] = 1.0

    @property
    def factor(self):
        return self.identification.factor

    def fly(self, seconds, flying=True, magnet=False):
        for _ in range(round(seconds / DT)):
            assumed = (MASS + self.hanging) * GRAVITY / self.truth
            self.state[2, :3] = self.noise * self.random.standard_normal(3)
            self.identification.switch(self.time, magnet)
            self.identification.update(self.time, self.state, 0.6, assumed, flying)
            self.time += DT
        return self.factor


@pytest.mark.parametrize("truth", [0.7, 0.85, 1.0, 1.2])
@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_it_converges(truth, noise):
    assert Hover(truth, noise).fly(60.0) == pytest.approx(truth, abs=0.01)


def test_it_converges_while_tilted_and_turned():
    hover = Hover()
    hover.state[0, 3:6] = 0.1, -0.05, 2.0
    # what stays of the thrust along z carries the weight; the share across it accelerates
    roll, pitch, yaw = hover.state[0, 3:6]
    axis = np.array(
        [
            math.cos(yaw) * math.sin(pitch) * math.cos(roll) + math.sin(yaw) * math.sin(roll),
            math.sin(yaw) * math.sin(pitch) * math.cos(roll) - math.cos(yaw) * math.sin(roll),
            math.cos(pitch) * math.cos(roll),
        ]
    )
    hover.identification.configure(
        ThrustIdentificationParameters.of(load_description(), {"identification_acceleration": 2.0})
    )
    thrust = MASS * GRAVITY
    acceleration = axis * GRAVITY - np.array([0.0, 0.0, GRAVITY])
    for k in range(15000):
        hover.state[2, :3] = acceleration
        hover.identification.update(1.0 + k * DT, hover.state, 0.6, thrust / hover.truth, True)
    assert hover.factor == pytest.approx(0.85, abs=0.01)


def test_the_slew_limit_holds():
    hover = Hover(0.6, factor_slew=0.01)
    before = hover.fly(1.0)
    assert before - hover.fly(2.0) == pytest.approx(0.02, rel=0.02)


@pytest.mark.parametrize(("truth", "bound"), [(0.2, 0.5), (2.5, 1.3)])
def test_it_stops_at_its_bounds(truth, bound):
    assert Hover(truth).fly(120.0) == pytest.approx(bound, abs=5e-3)


def test_frozen_it_stays_and_off_it_goes_back_to_one():
    hover = Hover()
    hover.fly(30.0)
    found = hover.factor
    on = hover.identification.parameters
    hover.identification.configure(replace(on, thrust_identification="freeze"))
    hover.truth = 1.1
    assert hover.fly(10.0) == found
    hover.identification.configure(replace(on, thrust_identification="off"))
    assert found < hover.fly(1.0) < 1.0  # no step in flight
    assert hover.fly(10.0) == 1.0


@pytest.mark.parametrize("yaml", [True, False])
def test_the_on_and_off_of_yaml_are_understood(yaml):
    checked = ThrustIdentificationParameters.of(load_description(), {"thrust_identification": yaml})
    assert checked.thrust_identification == ("on" if yaml else "off")


def test_wrong_parameters_leave_the_old_ones():
    identification = Identification()
    with pytest.raises(ParameterError, match="identification_mass"):
        identification.configure(ThrustIdentificationParameters(identification_mass=math.nan))
    assert identification.parameters == ThrustIdentificationParameters.of(load_description())


def on_the_ground(hover):
    hover.state[0, 2] = 0.2


def tilted(hover):
    hover.state[0, 3] = 0.3


@pytest.mark.parametrize("disturb", [on_the_ground, tilted])
def test_it_is_held_where_the_comparison_means_nothing(disturb):
    hover = Hover()
    disturb(hover)
    assert hover.fly(10.0) == 1.0


def test_it_is_held_while_accelerating_saturated_or_not_flying():
    hover = Hover()
    assert hover.fly(10.0, flying=False) == 1.0
    hover.state[0, 2] += 1.0
    for k in range(2500):
        time = 20.0 + k * DT
        hover.state[2, 2] = 3.0
        assert hover.identification.update(time, hover.state, 0.6, 30.0, True) == 1.0
        hover.state[2, 2] = 0.0
        assert hover.identification.update(time, hover.state, 0.95, 40.0, True) == 1.0


def test_a_vehicle_that_sways_is_not_measured_where_it_passes_through_rest():
    hover = Hover()
    for k in range(5000):
        hover.time += DT
        hover.state[2, 0] = 3.0 * math.sin(2.0 * math.pi * 2.0 * k * DT)
        hover.identification.update(hover.time, hover.state, 0.6, 25.0, True)
    assert hover.factor == 1.0


def test_a_payload_is_not_taken_for_weak_motors():
    hover = Hover()
    hover.fly(30.0)
    found = hover.factor
    hover.hanging = 0.2
    hover.fly(0.2, magnet=True)
    held = hover.factor
    assert held == pytest.approx(found, abs=2e-3)  # until the word of the magnet counts
    assert hover.fly(20.0, magnet=True) == held
    assert hover.fly(20.0) == held  # the magnet is off, but the payload still hangs
    hover.hanging = 0.0
    hover.fly(3.0)
    assert hover.factor != held
    assert hover.fly(20.0) == pytest.approx(0.85, abs=0.01)


def test_after_a_pick_before_identification_only_landing_frees_the_factor():
    hover = Hover()
    hover.fly(5.0, magnet=True)
    held = hover.factor
    assert held > 0.999 and hover.fly(20.0) == held
    hover.state[0, 2] = 0.0
    hover.fly(0.1, flying=False)
    hover.state[0, 2] = 1.0
    assert hover.fly(40.0) == pytest.approx(0.85, abs=0.01)


def test_a_gap_in_time_is_no_measurement():
    hover = Hover()
    identification = hover.identification
    for k in range(100):
        identification.update(10.0 + k * 0.2, hover.state, 0.6, 25.0, True)
        identification.update(10.0 + k * 0.2, hover.state, 0.6, 25.0, True)
    assert identification.factor == 1.0


anything = st.floats(allow_nan=True, allow_infinity=True)
sane = st.floats(-2.0, 2.0)
tick = st.tuples(
    st.one_of(st.just(DT), anything),
    st.lists(st.one_of(sane, anything), min_size=6, max_size=6),
    st.one_of(st.floats(0.0, 1.0), anything),
    st.one_of(st.floats(0.0, 50.0), anything),
    st.booleans(),
    st.booleans(),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(tick, min_size=1, max_size=60))
def test_whatever_comes_in_the_factor_stays_within_bounds_and_slew(ticks):
    identification = Identification()
    p = identification.parameters
    identification.update(0.0, np.zeros((3, 8)), 0.0, 0.0, False)
    state, time = np.zeros((3, 8)), 0.0
    for step, numbers, command, assumed, flying, magnet in ticks:
        time += step
        state[0, 2:6], state[2, :2] = numbers[:4], numbers[4:]
        before = identification.factor
        identification.switch(time, magnet)
        after = identification.update(time, state, command, assumed, flying)
        assert p.factor_min <= after <= p.factor_max
        assert abs(after - before) <= p.factor_slew * 0.1 + 1e-12  # a gap of 0.1 s is the longest
        if not math.isfinite(time):
            time = 0.0


@settings(max_examples=10)
@given(
    st.sampled_from([(0, 3), (0, 4), (0, 5), (2, 0), (2, 1), (2, 2), (0, 2)]),
    st.sampled_from([math.nan, math.inf, -math.inf]),
)
def test_what_is_not_finite_leaves_it_unchanged(where, bad):
    hover = Hover()
    hover.fly(1.0)
    found, learnt = hover.factor, hover.state.copy()
    learnt[where] = bad
    hover.identification.update(hover.time, learnt, 0.6, 25.0, True)
    assert hover.factor == found
    hover.fly(60.0)
    assert hover.factor == pytest.approx(0.85, abs=0.01)  # and does no lasting harm


@given(st.floats(0.5, 1.3), st.floats(5.0, 30.0))
def test_the_map_makes_newtons_newtons(factor, newtons):
    """Thrust and torque of the true motors are the desired ones for every factor."""
    truth, zero = RateThrustMap(), np.zeros(3)
    truth.thrust_factor = factor
    if newtons > 0.99 * FULL * factor:
        return
    torque = np.array([0.2, -0.1, 0.02])
    rates, thrust = truth.map(np.array([0.0, 0.0, newtons]), torque, zero, zero)
    assert factor * thrust_of_command(thrust, *truth.curve) == pytest.approx(newtons)
    p = truth.parameters
    gain = np.array(p.rate_p) * np.array(p.rate_k) * p.torque_scale(load_description()) * factor
    assert gain * rates == pytest.approx(torque)


def test_a_factor_that_is_no_factor_is_refused():
    m = RateThrustMap()
    m.thrust_factor = 0.9
    for bad in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="thrust factor"):
            m.thrust_factor = bad
    m.configure(m.parameters)
    assert m.thrust_factor == 0.9
