"""The reconstructed baselines against hand-worked numbers, and what must hold for any input."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.laws.asmc1 import Asmc1Law, Asmc1Parameters
from uam_control.laws.asmc2 import Asmc2Law, Asmc2Parameters
from uam_control.settings.parameter_set import ParameterError

DT = 0.004
ASMC1 = {
    "inertia": [2.0],
    "slope": [3.0],
    "damping": [5.0],  # A = 10
    "switching": [4.0],  # K = 8
    "boundary": [0.5],
    "gamma": 5.0,  # Gamma = 10
}
ASMC2 = {
    "inertia": [2.0],
    "rho_initial": [0.5],
    "rho_final": [0.5],
    "rho_rate": [1.0],
    "kappa": [2.0],
    "surface_gain": [3.0],
    "theta_initial": [0.5, 0.25, 0.125],
    "gamma": 2.0,
    "sigma": 0.5,
    "varpi": 1.0,
}
anything = st.floats(-1e6, 1e6)
size = st.floats(0.0, 1e6)


def asmc1(**changes):
    return Asmc1Law(Asmc1Parameters.from_mapping(ASMC1 | changes, 1))


def asmc2(**changes):
    return Asmc2Law(Asmc2Parameters.from_mapping(ASMC2 | changes, 1))


def update(law, e, e_dot, acceleration_d=0.0, rate=0.0, saturated=False, dt=DT):
    """One axis; rate is ||chi_dot||, the only norm that a baseline sees."""
    one = (np.array([value]) for value in (e, e_dot, acceleration_d))
    return float(law.update(*one, np.array([7.0, 9.0, rate]), saturated, dt)[0])


def test_asmc1_inside_the_boundary_layer_by_hand():
    # s = -0.1 + 3*0.1 = 0.2, sat = 0.2/0.5 = 0.4, chi_r_ddot - chi_d_ddot = -3*(-0.1) = 0.3
    # tau = 2 (1 + 0.3) - 10*0.2 - 8*0.4 = 2.6 - 2 - 3.2 = -2.6; D = -10*0.2*0.004 = -0.008
    law = asmc1()
    assert update(law, 0.1, -0.1, 1.0) == pytest.approx(-2.6)
    np.testing.assert_allclose(law.adaptation, [-0.008, 0.2])
    assert update(law, 0.1, -0.1, 1.0) == pytest.approx(-2.608)
    assert law.names == ("D1", "s_norm")


def test_asmc1_outside_the_boundary_layer_and_with_sign_by_hand():
    # s = 3*0.5 = 1.5: tau = -10*1.5 - 8 = -23
    assert update(asmc1(), 0.5, 0.0) == pytest.approx(-23.0)
    assert update(asmc1(), -0.5, 0.0) == pytest.approx(23.0)
    # as in the first test, but K sign(s) = 8: tau = 2.6 - 2 - 8
    assert update(asmc1(switching_form="sign"), 0.1, -0.1, 1.0) == pytest.approx(-7.4)
    assert update(asmc1(switching_form="sign"), 0.0, 0.0) == 0.0


def test_only_the_disturbance_is_drawn_with_its_sign():
    assert [group.signed for group in Asmc1Law.gain_groups(2)] == [True, False]
    assert not any(group.signed for group in Asmc2Law.gain_groups(2))


def test_asmc1_axes_are_apart_and_frozen_ones_still_act():
    values = {"inertia": [2.0, 1.0], "slope": [3.0, 1.0], "damping": [5.0, 2.0]}
    values |= {"switching": [4.0, 1.0], "boundary": [0.5, 2.0]}
    e, e_dot, none = np.array([0.5, 1.0]), np.array([0.0, -2.0]), np.zeros(2)
    for adapt, expected in ((True, [-0.06, 0.02]), (False, [0.0, 0.0])):
        law = Asmc1Law(Asmc1Parameters.from_mapping(ASMC1 | values | {"adapt": adapt}, 2))
        tau = law.update(e, e_dot, none, np.zeros(3), False, DT)
        # s = (1.5, 1 - 2 = -1); tau_1 = -10*1.5 - 8 = -23, tau_2 = 2 + 2 + 1*.5 = 4.5
        np.testing.assert_allclose(tau, [-23.0, 4.5])
        # -Gamma s dt = (-10*1.5*.004, 5*1*.004); ||s||^2 = 2.25 + 1
        np.testing.assert_allclose(law.adaptation, [*expected, math.sqrt(3.25)])
        law.reset_adaptation()
        np.testing.assert_allclose(law.adaptation, [0.0, 0.0, math.sqrt(3.25)])


def test_asmc2_by_hand():
    # rho = 0.5: eta = 0.5, R = 1/(0.5*0.75) = 8/3, epsilon = ln(3)/2 = 0.549306
    # epsilon_dot = 8/3*0.3 = 0.8, s = 0.8 + 2*0.549306 = 1.898612, w = 8/3 s = 5.062966
    # R_dot/R = 2 eta eta_dot/(1 - eta^2) = 2*0.5*0.6/0.75 = 0.8, times e_dot: 0.24
    # kappa e_dot = 0.6; k_s s/R = 3*0.375*1.898612 = 2.135939
    # theta Y = 0.5 + 0.25*2 + 0.125*4 = 1.5, times 5.062966/6.062966 = 0.835064: 1.252596
    # tau = 2 (1 - 0.24 - 0.6 - 2.135939 - 1.252596) = -6.457070
    law = asmc2()
    assert update(law, 0.25, 0.3, 1.0, rate=2.0) == pytest.approx(-6.45707, abs=1e-5)
    assert law.adaptation[3] == pytest.approx(5.062966, abs=1e-6)
    assert law.adaptation[4] == 0.5 and law.adaptation[5] == 0
    # gamma sigma = 1: theta_i = theta_i e^-dt + (1 - e^-dt) ||w|| 2^i / 0.5
    keep = math.exp(-DT)
    for i, start in enumerate([0.5, 0.25, 0.125]):
        grown = start * keep + (1.0 - keep) * 5.062966 * 2**i / 0.5
        assert law.adaptation[i] == pytest.approx(grown, abs=1e-6)


@pytest.mark.parametrize(("e", "e_dot"), [(0.3, 0.2), (-0.5, 0.4), (0.1, -0.6)])
def test_asmc2_makes_s_decay_with_k_s_while_the_funnel_narrows(e, e_dot):
    """Without theta the law is an exact linearisation: M e_ddot = tau leaves s_dot = -k_s s.

    s is worked out here from the definitions, rho(t) = 0.5 exp(-1.5 t) + 0.5.
    """
    law = asmc2(rho_initial=[1.0], rho_rate=[1.5], theta_initial=[0.0] * 3, adapt=False)
    step, t = 1e-4, 0.0

    def surface():
        rho, rho_dot = 0.5 * math.exp(-1.5 * t) + 0.5, -0.75 * math.exp(-1.5 * t)
        eta, eta_dot = e / rho, (e_dot - e * rho_dot / rho) / rho
        return eta_dot / (1.0 - eta * eta) + 2.0 * math.atanh(eta)

    start = surface()
    while t < 1.0:
        e_ddot = update(law, e, e_dot, dt=step) / 2.0
        e += e_dot * step + 0.5 * e_ddot * step**2
        e_dot += e_ddot * step
        t += step
    assert surface() == pytest.approx(start * math.exp(-3.0 * t), rel=5e-3)


def test_asmc2_clamps_eta_and_counts():
    law = asmc2(adapt=False)
    far, farther = update(law, 3.0, 0.1), update(law, -200.0, 0.1)
    assert law.adaptation[5] == 2
    assert law.adaptation[4] == 400.0  # |eta| before the clamp
    inside = update(law, 0.49, 0.1)  # eta = 0.98 is the last that is not clamped
    assert law.adaptation[5] == 2
    assert far == pytest.approx(inside) and farther > 0.0 > far
    law.reset()
    assert law.adaptation[5] == 0


def test_asmc2_counts_time_from_its_reset():
    law = asmc2(rho_initial=[1.0], adapt=False)
    first = update(law, 0.2, 0.0)
    for _ in range(1000):
        later = update(law, 0.2, 0.0)
    assert later != first
    law.reset()
    assert update(law, 0.2, 0.0) == first


@pytest.mark.parametrize("make", [asmc1, asmc2])
@given(
    inputs=st.lists(st.tuples(anything, anything, anything, size), min_size=1, max_size=5),
    saturated=st.booleans(),
    dt=st.floats(1e-6, 1e3),
)
def test_any_finite_input_gives_finite_output(make, inputs, saturated, dt):
    law = make(freeze_when_saturated=True)
    for e, e_dot, acceleration_d, rate in inputs:
        assert math.isfinite(update(law, e, e_dot, acceleration_d, rate, saturated, dt))
    assert np.all(np.isfinite(law.adaptation))


@given(
    inputs=st.lists(st.tuples(anything, anything, size), min_size=1, max_size=8),
    dt=st.floats(1e-6, 1e3),
)
def test_theta_is_never_negative(inputs, dt):
    law = asmc2()
    for e, e_dot, rate in inputs:
        update(law, e, e_dot, 0.0, rate, dt=dt)
        assert np.all(law.adaptation[:3] >= 0.0)


@given(dt=st.floats(1e-4, 10.0), e=st.floats(-0.4, 0.4), rate=st.floats(0.0, 5.0))
def test_theta_after_one_long_step_is_that_of_two_halves(dt, e, rate):
    whole, halves = asmc2(), asmc2()  # the funnel is constant, hence w too
    update(whole, e, 0.0, 0.0, rate, dt=dt)
    for _ in range(2):
        update(halves, e, 0.0, 0.0, rate, dt=dt / 2)
    np.testing.assert_allclose(whole.adaptation[:3], halves.adaptation[:3], rtol=1e-9)


@given(
    errors=st.lists(st.floats(-10, 10), min_size=1, max_size=20),
    largest=st.floats(0.1, 5.0),
    dt=st.floats(1e-4, 1.0),
)
def test_disturbance_is_bounded_by_the_sum_of_s_and_by_its_ceiling(errors, largest, dt):
    law, limited = asmc1(), asmc1(disturbance_ceiling=largest)
    bound = 0.0
    for e in errors:
        for each in (law, limited):
            update(each, e, 0.0, dt=dt)
        bound += 10.0 * 3.0 * abs(e) * dt  # Gamma |s| dt
        assert abs(law.adaptation[0]) <= bound * (1.0 + 1e-9)
        assert abs(limited.adaptation[0]) <= largest


def test_saturation_freezes_growth_but_not_decay():
    law = asmc1(freeze_when_saturated=True)
    update(law, 1.0, 0.0)
    held = law.adaptation[0]
    update(law, 1.0, 0.0, saturated=True)
    assert law.adaptation[0] == held
    update(law, -0.5, 0.0, saturated=True)
    assert (held, law.adaptation[0]) == pytest.approx((-0.12, -0.06))  # s = 3, then -1.5
    law = asmc2(freeze_when_saturated=True)
    update(law, 0.4, 0.0, rate=2.0, saturated=True)
    np.testing.assert_array_equal(law.adaptation[:3], ASMC2["theta_initial"])


def test_theta_stays_below_its_ceiling():
    law = asmc2(theta_ceiling=[0.6, 0.0, 0.0])
    for _ in range(2000):
        update(law, 0.4, 0.0, rate=2.0)
    assert law.adaptation[0] == 0.6 and law.adaptation[1] > 1.0


def test_without_adaptation_the_gains_keep_their_initial_values():
    first, second = asmc1(adapt=False), asmc2(adapt=False)
    for law in (first, second):
        update(law, 0.4, 1.0, rate=3.0)
    assert first.adaptation[0] == 0.0 and first.adaptation[1] == 2.2  # s = 1 + 3*.4
    np.testing.assert_array_equal(second.adaptation[:3], ASMC2["theta_initial"])


@pytest.mark.parametrize("make", [asmc1, asmc2])
@pytest.mark.parametrize(("freeze", "saturated"), [(False, True), (True, False)])
def test_gains_grow_unless_they_are_frozen_and_the_actuator_saturates(make, freeze, saturated):
    law, plain = make(freeze_when_saturated=freeze), make()
    update(law, 0.4, 1.0, rate=3.0, saturated=saturated)
    update(plain, 0.4, 1.0, rate=3.0)
    np.testing.assert_array_equal(law.adaptation, plain.adaptation)


def test_asmc2_keeps_its_count_and_its_time_apart():
    law = asmc2()
    for _ in range(3):
        update(law, 3.0, 0.1)
    # eta = 3/.5; clamped in each of three ticks of 4 ms
    np.testing.assert_allclose(law.adaptation[4:], [6.0, 3.0, 0.012])
    law.reset_adaptation()
    np.testing.assert_allclose(law.adaptation[[0, 1, 2, 5, 6]], [0.5, 0.25, 0.125, 3.0, 0.012])


@pytest.mark.parametrize(
    ("parameters", "change", "reason"),
    [
        (Asmc1Parameters, {"slope": [0.0]}, "slope.*outside"),
        (Asmc1Parameters, {"switching_form": "tanh"}, "sat, sign"),
        (Asmc1Parameters, {"law": "modular"}, "law: 'modular' is not one of asmc1"),
        (Asmc2Parameters, {"rho_final": [0.0]}, "rho_final.*outside"),
        (Asmc2Parameters, {"sigma": 0.0}, "sigma.*outside"),
        (Asmc2Parameters, {"theta_initial": [1.0]}, "theta_initial.*3 numbers"),
    ],
)
def test_bad_parameters_are_refused_with_the_reason(parameters, change, reason):
    good = ASMC1 if parameters is Asmc1Parameters else ASMC2
    with pytest.raises(ParameterError, match=reason):
        parameters.from_mapping(good | change, 1)
