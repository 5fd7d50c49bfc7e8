"""The modular adaptive law against hand-worked numbers and the properties that the paper proves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_lyapunov

from uam_control.laws.law_parameters import structured
from uam_control.laws.modular import ModularLaw, ModularParameters, lyapunov_solution
from uam_control.settings.parameter_set import ParameterError

ONE_AXIS = {
    "inertia": [2.0],
    "lambda_1": [4.0],
    "lambda_2": [3.0],
    "lambda_table": [1.5],
    "q_position": [8.0],
    "q_velocity": [4.0],
    "k_initial": [0.5, 0.25, 0.125, 0.0625],
    "zeta_initial": 0.1,
    "nu": [1.0, 2.0, 4.0, 8.0],
    "epsilon": 0.2,
    "varpi": 0.5,
}
# by hand: p12 = 8 / (2*4) = 1, p22 = (4 + 2*1) / (2*3) = 1, p11 = 3*1 + 4*1 = 7
AXIS_VECTORS = ("lambda_1", "lambda_2", "lambda_table", "q_position", "q_velocity")
DT = 0.004
positive = st.floats(1e-3, 1e3)


def law(**changes):
    return ModularLaw(ModularParameters.from_mapping(ONE_AXIS | changes, 1))


def update(a_law, e, e_dot, acceleration_d=0.0, norms=(0.0, 0.0, 0.0), saturated=False, dt=DT):
    return float(
        a_law.update(
            np.array([e]),
            np.array([e_dot]),
            np.array([acceleration_d]),
            np.array(norms, dtype=float),
            saturated,
            dt,
        )[0]
    )


def test_lyapunov_by_hand():
    p11, p12, p22 = lyapunov_solution(*(np.array([v]) for v in (4.0, 3.0, 8.0, 4.0)))
    assert (p11[0], p12[0], p22[0]) == (7.0, 1.0, 1.0)


@given(lambda_1=positive, lambda_2=positive, q_1=positive, q_2=positive)
def test_lyapunov_solves_its_equation_and_is_positive_definite(lambda_1, lambda_2, q_1, q_2):
    p11, p12, p22 = (
        float(v[0])
        for v in lyapunov_solution(*(np.array([v]) for v in (lambda_1, lambda_2, q_1, q_2)))
    )
    a = np.array([[0.0, 1.0], [-lambda_1, -lambda_2]])
    p = np.array([[p11, p12], [p12, p22]])
    scale = np.abs(a).max() * np.abs(p).max() + q_1 + q_2
    np.testing.assert_allclose(a.T @ p + p @ a, -np.diag([q_1, q_2]), atol=1e-9 * scale)
    assert p11 > 0.0 and p11 * p22 - p12 * p12 > 0.0


def test_lyapunov_agrees_with_scipy_on_the_full_matrix():
    lambda_1, lambda_2 = np.array([4.0, 9.0, 2.0]), np.array([3.0, 5.0, 0.5])
    q_1, q_2 = np.array([8.0, 1.0, 700.0]), np.array([4.0, 2.0, 5.0])
    a = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.diag(lambda_1), -np.diag(lambda_2)]])
    p = solve_continuous_lyapunov(a.T, -np.diag(np.concatenate([q_1, q_2])))
    p11, p12, p22 = lyapunov_solution(lambda_1, lambda_2, q_1, q_2)
    ours = np.block([[np.diag(p11), np.diag(p12)], [np.diag(p12), np.diag(p22)]])
    np.testing.assert_allclose(ours, p, rtol=1e-9, atol=1e-9)


def test_tau_outside_the_boundary_layer_by_hand():
    # r = 1*0.5 + 1*0.25 = 0.75 >= varpi; rho = .5 + .25*2 + .125*4 + .0625*8 + .1 = 2.1
    # tau = 2 (1 - 4*0.5 - 3*0.25 - 2.1) = -7.7
    a_law = law()
    assert update(a_law, 0.5, 0.25, 1.0, (2.0, 8.0, 0.0)) == pytest.approx(-7.7)
    assert a_law.adaptation[5] == pytest.approx(2.1)
    assert a_law.adaptation[6] == pytest.approx(0.75)


def test_tau_inside_the_boundary_layer_by_hand():
    # r = 0.25 < varpi = 0.5: dtau = 2.1 * 0.25 / 0.5 = 1.05; tau = 2 (-4*0.25 - 1.05) = -4.1
    assert update(law(), 0.25, 0.0, 0.0, (2.0, 8.0, 0.0)) == pytest.approx(-4.1)


def test_table_form_by_hand():
    # Lambda (e_dot + 2 e) = 1.5 (0.25 + 1) = 1.875; dtau = 2.1; tau = 2 (-1.875 - 2.1)
    value = update(law(lambda_form="table"), 0.5, 0.25, 0.0, (2.0, 8.0, 0.0))
    assert value == pytest.approx(-7.95)


def test_sliding_form_by_hand():
    # c = 4/3: Lambda (e_dot + c e) = 1.5 (1/4 + 2/3) = 11/8, c e_dot = 1/3; dtau = 2.1
    value = update(law(lambda_form="sliding"), 0.5, 0.25, 0.0, (2.0, 8.0, 0.0))
    assert value == pytest.approx(-2.0 * (11.0 / 8.0 + 1.0 / 3.0 + 2.1))


def test_adaptive_laws_by_hand():
    """K' = r x - nu K integrated exactly over a tick: K e^(-nu dt) + (1 - e^(-nu dt)) r x / nu."""
    a_law = law()
    update(a_law, 0.5, 0.25, 0.0, (2.0, 8.0, 0.0))
    r = 0.75
    for i, (start, nu, regressor) in enumerate(
        [(0.5, 1.0, 1.0), (0.25, 2.0, 2.0), (0.125, 4.0, 4.0), (0.0625, 8.0, 8.0)]
    ):
        keep = math.exp(-nu * DT)
        expected = start * keep + (1.0 - keep) * r * regressor / nu
        assert a_law.adaptation[i] == pytest.approx(expected, rel=1e-12)
    assert a_law.adaptation[4] == 0.1  # zeta rests outside the boundary layer


def test_zeta_inside_the_boundary_layer_by_hand():
    a_law = law()
    update(a_law, 0.25, 0.0, 0.0, (2.0, 8.0, 0.0))
    rate = 1.0 + 2.0 * 0.25  # 1 + (rho - zeta) ||r||
    expected = 0.1 * math.exp(-rate * DT) + (1.0 - math.exp(-rate * DT)) * 0.2 / rate
    assert a_law.adaptation[4] == pytest.approx(expected, rel=1e-12)


@given(
    e=st.floats(-10, 10),
    e_dot=st.floats(-10, 10),
    xi=st.floats(0, 20),
    acceleration=st.floats(0, 100),
    dt=st.floats(1e-6, 1e3),
)
def test_gains_stay_positive_for_any_step(e, e_dot, xi, acceleration, dt):
    a_law = law()
    for _ in range(5):
        update(a_law, e, e_dot, 0.0, (xi, acceleration, 0.0), dt=dt)
    assert np.all(a_law.adaptation[:5] > 0.0)
    assert np.all(np.isfinite(a_law.adaptation))


@given(xi=st.floats(0, 10), acceleration=st.floats(0, 50))
def test_tau_is_continuous_at_the_boundary_layer(xi, acceleration):
    below, above = (
        update(law(), 0.5 + step, 0.0, 0.0, (xi, acceleration, 0.0)) for step in (-1e-9, 1e-9)
    )
    assert below == pytest.approx(above, abs=1e-5)


@given(dt=st.floats(1e-4, 10.0), e=st.floats(0.6, 3.0), xi=st.floats(0.0, 5.0))
def test_one_long_step_equals_two_halves(dt, e, xi):
    """The exact integration does not depend on the step (outside the boundary layer)."""
    whole, halves = law(), law()
    update(whole, e, 0.0, 0.0, (xi, 3.0, 0.0), dt=dt)
    for _ in range(2):
        update(halves, e, 0.0, 0.0, (xi, 3.0, 0.0), dt=dt / 2)
    np.testing.assert_allclose(whole.adaptation[:4], halves.adaptation[:4], rtol=1e-9)


@pytest.mark.parametrize(
    ("xi", "acceleration"),
    [(2.0, 5.0), (3.0, 0.5)],  # xi^3 is not the acceleration
)
def test_each_gain_has_its_regressor(xi, acceleration):
    """Over a tick so long that the gain forgets its start, K_i = r x_i / nu_i."""
    a_law = law()
    update(a_law, 1.5, -0.75, 0.0, (xi, acceleration, 9.0), dt=1e3)  # r = 0.75
    expected = 0.75 * np.array([1.0, xi / 2.0, xi * xi / 4.0, acceleration / 8.0])
    np.testing.assert_allclose(a_law.adaptation[:4], expected, rtol=1e-12)


def test_low_pass_on_the_acceleration_by_hand():
    # corner 1/(2 pi) Hz: time constant 1 s; after ln 2 s half of a step is there
    a_law = law(acceleration_cutoff=0.5 / math.pi)
    half = math.log(2.0)
    update(a_law, 0.5, 0.25, 0.0, (2.0, 8.0, 0.0), dt=half)
    # rho = .5 + .25*2 + .125*4 + .0625*4 + .1 = 1.85 with half of 8; K3 saw 4 as well
    np.testing.assert_allclose(a_law.adaptation[5:], [1.85, 0.75, 0.0, 4.0])
    keep = math.exp(-8.0 * half)
    assert a_law.adaptation[3] == pytest.approx(0.0625 * keep + (1.0 - keep) * 0.75 * 4.0 / 8.0)
    update(a_law, 0.5, 0.25, 0.0, (2.0, 8.0, 0.0), dt=half)
    assert a_law.adaptation[-1] == pytest.approx(6.0)  # half of what was missing


def test_three_axes_share_one_norm_of_r_by_hand():
    three = {name: [value[0]] * 3 for name, value in ONE_AXIS.items() if name in AXIS_VECTORS}
    three |= {"inertia": [1.0, 2.0, 4.0]}
    a_law = ModularLaw(ModularParameters.from_mapping(ONE_AXIS | three, 3))
    e, e_dot = np.array([1.0, 0.0, 2.0]), np.array([0.0, 2.0, 0.0])
    tau = a_law.update(e, e_dot, np.array([0.0, 1.0, 0.0]), np.zeros(3), False, DT)
    # r = (1, 2, 2), ||r|| = 3; rho = .5 + .1 = .6: dtau = .2 r; feedback = (4, 6, 8)
    # tau = (-4 - .2, 2 (1 - 6 - .4), 4 (-8 - .4))
    np.testing.assert_allclose(tau, [-4.2, -10.8, -33.6])
    np.testing.assert_allclose(a_law.adaptation[5:], [0.6, 3.0, 0.0, 0.0, 0.0, 0.0])


def test_zeta_rests_at_the_edge_of_the_boundary_layer():
    a_law = law()
    update(a_law, 0.5, 0.0)  # r = varpi
    assert a_law.adaptation[4] == 0.1


def test_a_gain_that_has_decayed_keeps_the_floor():
    a_law = law()
    update(a_law, 0.0, 0.0, dt=1e6)
    np.testing.assert_array_equal(a_law.adaptation[:4], 1e-12)


def test_ceiling_projects_each_gain():
    a_law = law(k_ceiling=[0.6, 0.0, 0.2, 0.0])
    for _ in range(2000):
        update(a_law, 5.0, 0.0, 0.0, (2.0, 8.0, 0.0))
    assert a_law.adaptation[0] == 0.6 and a_law.adaptation[2] == 0.2
    # 0 means no ceiling: after 8 s, r x/nu = 5*2/2 and 5*8/8
    np.testing.assert_allclose(a_law.adaptation[[1, 3]], [5.0, 5.0], rtol=1e-6)


def test_saturation_freezes_growth_but_not_decay():
    a_law = law(freeze_when_saturated=True)
    update(a_law, 5.0, 0.0, 0.0, (2.0, 8.0, 0.0), saturated=True)
    np.testing.assert_array_equal(a_law.adaptation[:4], ONE_AXIS["k_initial"])
    update(a_law, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0), saturated=True)
    # without r a gain decays by e^(-nu dt)
    decayed = [0.5, 0.25, 0.125, 0.0625] * np.exp([-0.004, -0.008, -0.016, -0.032])
    np.testing.assert_allclose(a_law.adaptation[:4], decayed, rtol=1e-12)


@pytest.mark.parametrize(("freeze", "saturated"), [(False, True), (True, False)])
def test_gains_grow_unless_they_are_frozen_and_the_actuator_saturates(freeze, saturated):
    a_law, plain = law(freeze_when_saturated=freeze), law()
    update(a_law, 5.0, 0.0, 0.0, (2.0, 8.0, 0.0), saturated=saturated)
    update(plain, 5.0, 0.0, 0.0, (2.0, 8.0, 0.0))
    np.testing.assert_array_equal(a_law.adaptation, plain.adaptation)


def test_acceleration_limit_bounds_the_regressor():
    limited, plain = law(acceleration_limit=1.0), law()
    update(limited, 1.0, 0.0, 0.0, (0.0, 50.0, 0.0))
    update(plain, 1.0, 0.0, 0.0, (0.0, 1.0, 0.0))
    assert limited.adaptation[3] == plain.adaptation[3]


def test_freeze_keeps_the_gains_and_reset_restores_them():
    a_law = law()
    a_law.frozen = True
    update(a_law, 5.0, 0.0)
    np.testing.assert_array_equal(a_law.adaptation[:4], ONE_AXIS["k_initial"])
    a_law.frozen = False
    update(a_law, 5.0, 0.0)
    a_law.reset_adaptation()
    np.testing.assert_array_equal(a_law.adaptation[:5], [0.5, 0.25, 0.125, 0.0625, 0.1])
    assert a_law.adaptation[6] == 5.0  # ||r|| of the last tick is no adapted gain
    a_law.reset()
    np.testing.assert_array_equal(a_law.adaptation, [0.5, 0.25, 0.125, 0.0625, 0.1, 0, 0, 0, 0])


SINGULAR = {"lambda_1": [0.25], "lambda_2": [1e6], "q_position": [1e6]}


def test_a_matrix_p_that_is_singular_in_double_precision_is_refused():
    # p12 = 1e6/.5 = 2e6, p22 = (q_v + 4e6)/2e6 = 2, p11 = 2e12: p11 p22 is 4e12 = p12^2, and more
    # by the shares lambda_1/lambda_2^2 = 2.5e-13 and q_v/(2 p12), of which 1e-12 is the least
    with pytest.raises(ParameterError, match="a matrix P that is not positive definite"):
        law(**SINGULAR, q_velocity=[1e-9])
    p11, p12, p22 = law(**SINGULAR, q_velocity=[1e-5]).parameters.lyapunov_matrix()  # 2.5e-12
    np.testing.assert_allclose([p11[0], p12[0], p22[0]], [2e12, 2e6, 2.0])


def test_a_law_reads_one_record():
    record = structured({"vector": (1.0, 2.0), "number": 3.0})
    assert record.shape == (1,) and record[0].number == 3.0
    np.testing.assert_array_equal(record[0].vector, [1.0, 2.0])


def test_safeguards_that_are_on_are_named():
    parameters = law(
        k_ceiling=[0.0, 2.0, 0.0, 0.0], acceleration_cutoff=5.0, freeze_when_saturated=True
    ).parameters
    assert parameters.safeguards == ["k_ceiling", "freeze_when_saturated", "acceleration_cutoff"]
    assert law().parameters.safeguards == []


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"inertia": [0.0]}, "inertia.*outside"),
        ({"lambda_1": [-4.0]}, "lambda_1.*outside"),
        ({"q_position": [float("nan")]}, "q_position.*outside"),
        ({"lambda_2": [1.0, 2.0]}, "lambda_2.*1 numbers"),
        ({"nu": [1.0]}, "nu.*4 numbers"),
        ({"varpi": "wide"}, "varpi.*not numeric"),
        ({"lambda_form": "other"}, "lambda_form.*theory, table, sliding"),
        ({"freeze_when_saturated": 1}, "true or false"),
        ({"gain": 1.0}, "gain: unknown"),
    ],
)
def test_bad_parameters_are_refused_with_the_reason(change, reason):
    with pytest.raises(ParameterError, match=reason):
        ModularParameters.from_mapping(ONE_AXIS | change, 1)


BIAS = 7  # of the gains: where theta_hat begins


def test_bias_by_hand():
    """r = e + e_dot = 0.3; theta_hat' = 10 r; dtau has theta_hat, tau = -2 (...)."""
    a_law, printed = law(bias_gain=[10.0]), law()
    assert update(a_law, 0.2, 0.1) == update(printed, 0.2, 0.1)
    assert a_law.adaptation[BIAS] == pytest.approx(0.012)
    assert update(a_law, 0.2, 0.1) == pytest.approx(update(printed, 0.2, 0.1) - 2.0 * 0.012)


def test_bias_leaks():
    """theta_hat' = 10 * 0.3 - 2 theta_hat from 0: 1.5 (1 - exp(-2 t))."""
    a_law = law(bias_gain=[10.0], bias_leakage=2.0)
    for _ in range(250):
        update(a_law, 0.2, 0.1)
    assert a_law.adaptation[BIAS] == pytest.approx(1.5 * (1.0 - math.exp(-2.0)))


def test_bias_does_not_grow_while_saturated_and_may_shrink():
    a_law = law(bias_gain=[10.0])
    update(a_law, 0.2, 0.1)
    update(a_law, 0.2, 0.1, saturated=True)
    assert a_law.adaptation[BIAS] == pytest.approx(0.012)
    update(a_law, -0.05, -0.05, saturated=True)
    assert a_law.adaptation[BIAS] == pytest.approx(0.008)


def test_frozen_adaptation_keeps_the_bias():
    a_law = law(bias_gain=[10.0], adapt=False)
    update(a_law, 0.2, 0.1)
    assert a_law.adaptation[BIAS] == 0.0


@given(
    st.lists(st.floats(-30.0, 30.0), min_size=6, max_size=6),
    st.lists(st.floats(0.0, 100.0), min_size=3, max_size=3),
    st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3),
)
def test_bias_stays_in_its_ball_and_does_not_raise_the_lyapunov_function(errors, gamma, true):
    """V = 1/2 theta~' Gamma^-1 theta~ changes by at most theta~' r dt, plus what the step adds."""
    three = {name: ONE_AXIS[name] * 3 for name in ("inertia", *AXIS_VECTORS)}
    values = ONE_AXIS | three | {"bias_gain": [g + 0.1 for g in gamma], "bias_limit": 2.0}
    a_law = ModularLaw(ModularParameters.from_mapping(values, 3))
    e, e_dot = np.array(errors[:3]), np.array(errors[3:])
    r, gain, dt = e + e_dot, np.array(values["bias_gain"]), 1e-6
    true, zero = np.array(true), np.zeros(3)
    a_law.adaptation[BIAS:-1] = np.array([1.2, -1.6, 0.0])  # on the ball
    before = a_law.adaptation[BIAS:-1] - true
    a_law.update(e, e_dot, zero, zero, False, dt)
    after = a_law.adaptation[BIAS:-1] - true
    assert np.linalg.norm(a_law.adaptation[BIAS:-1]) <= 2.0 * (1.0 + 1e-12)
    change = 0.5 * np.sum((after**2 - before**2) / gain)
    # the ball's centre is 0: radial scaling moves by the square of a step
    rest = 10.0 * np.sum((gain * np.abs(r) * dt) ** 2) / gain.min() + 1e-15
    assert change <= np.sum(before * r) * dt + rest
