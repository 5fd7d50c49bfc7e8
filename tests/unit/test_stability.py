"""K*, V and its bound: worked by hand, in a closed loop that fits the proof, in a flight."""

from dataclasses import replace

import numpy as np
import pytest
from default_columns import COLUMNS

from uam_control.laws.modular import ModularLaw, ModularParameters
from uam_control.profiles.profile import load_profile
from uam_lab.analysis import constants, lyapunov_bound, stability, tracking
from uam_lab.analysis.coupling import nominal_inertia
from uam_lab.analysis.lyapunov_bound import ComparisonSystem
from uam_lab.analysis.stability import analyse_folder
from uam_lab.analysis.supply import COLUMNS_OF
from uam_lab.analysis.tracking import Tracking
from uam_lab.records.results.timeseries import Series
from uam_lab.report.figures import figures, panels
from uam_sim_bridge.plant import Vehicle

LAW = ModularParameters(
    inertia=(1.0, 1.0, 1.0),
    lambda_1=(4.0, 4.0, 4.0),
    lambda_2=(4.0, 4.0, 4.0),
    lambda_table=(1.0, 1.0, 1.0),
    q_position=(1.0, 1.0, 1.0),
    q_velocity=(1.0, 1.0, 1.0),
    k_initial=(0.1, 0.1, 0.1, 0.1),
    zeta_initial=0.1,
    nu=(1.0, 2.0, 2.0, 2.0),
    epsilon=0.1,
    varpi=0.05,
    bias_gain=(0.0, 0.0, 0.0),
)
MENDED = replace(LAW, bias_gain=(40.0, 20.0, 20.0), bias_limit=1.2)


def tracking_of(e, e_dot, acceleration=0.0):
    """Return a Tracking with errors e, e_dot (m, 3) of the position, all others zero."""
    whole = [np.hstack([x, np.zeros((len(x), 5))]) for x in (e, e_dot, np.zeros_like(e))]
    xi = np.linalg.norm(np.hstack([e, e_dot]), axis=1)
    still = np.zeros(len(e))
    return Tracking(*whole, xi, still + acceleration, still, still)


def test_constants_worked_by_hand():
    regressors = np.column_stack([np.ones(3), [0, 1, 2], [0, 1, 4], np.zeros(3)])
    nu = np.ones(4)
    # only the first constraint is active, and only K*0 enters it
    np.testing.assert_allclose(
        constants.smallest(np.array([3.0, 1.0, 0.0]), regressors, nu), [3, 0, 0, 0], atol=1e-9
    )
    # one constraint a K >= s: the shortest K is s a / ||a||^2
    row = np.array([[1.0, 2.0, 4.0, 2.0]])
    np.testing.assert_allclose(constants.smallest(np.array([5.0]), row, nu), row[0] / 5.0)
    # the norm of sqrt(nu) K is minimised: nu = 4 doubles the weight of that gain
    heavy = constants.smallest(np.array([5.0]), row, np.array([4.0, 1.0, 1.0, 1.0]))
    np.testing.assert_allclose(heavy, np.array([0.25, 2.0, 4.0, 2.0]) * 5.0 / 24.25)


@pytest.mark.parametrize("seed", range(5))
def test_constants_bound_every_tick_and_are_not_larger_than_needed(seed):
    rng = np.random.default_rng(seed)
    xi = rng.uniform(0, 2, 400)
    regressors = np.column_stack([np.ones(400), xi, xi**2, rng.uniform(0, 30, 400)])
    sigma = regressors @ [0.5, 0.0, 0.3, 0.1] * rng.uniform(0.2, 1.0, 400)
    nu = np.array([0.3, 2.0, 2.0, 6.0])
    found = constants.smallest(sigma, regressors, nu)
    assert np.all(found >= 0.0)
    assert np.all(regressors @ found >= sigma * (1 - 1e-9))
    assert nu @ found**2 <= nu @ np.array([0.5, 0.0, 0.3, 0.1]) ** 2 + 1e-9


def test_no_uncertainty_needs_no_constants():
    np.testing.assert_array_equal(
        constants.smallest(np.zeros(3), np.ones((3, 4)), np.ones(4)), np.zeros(4)
    )


def test_v_and_bound_worked_by_hand():
    """lambda = 4, Q = 1: p12 = 1/8, p22 = (1 + 1/4)/8, p11 = 1/2 + 5/8."""
    record = LAW.record()[0]
    e, e_dot = np.array([[2.0, 0, 0], [0, 0, 0]]), np.array([[1.0, 0, 0], [0, 0, 0]])
    gains = np.array([[1.0, 0, 0, 0], [3.0, 1, 0, 0]])
    zeta, star = np.array([0.2, 0.1]), np.array([2.0, 0, 0, 1.0])
    off = np.zeros((2, 3))
    parts = lyapunov_bound.parts("position", record, tracking_of(e, e_dot), gains, zeta, star, off)
    np.testing.assert_allclose(parts.tracking, [0.5 * (4 * 1.125 + 2 * 2 * 0.125 + 0.15625), 0.0])
    np.testing.assert_allclose(parts.gains, [1.0, 1.5])
    np.testing.assert_allclose(parts.zeta, [2.0, 1.0])
    matrix = np.array([[1.125, 0.125], [0.125, 0.15625]])
    largest = np.linalg.eigvalsh(matrix)[1]
    found = lyapunov_bound.comparison(LAW, zeta, star, np.zeros(3))
    assert found.rate == pytest.approx(1.0 / largest)
    growth = found.rate * 2.0 + 0.1 / 0.1 + 0.5 * (1.0 * 4.0 + 2.0 * 1.0)
    assert found.growth == pytest.approx(growth)
    assert found.bound == pytest.approx(growth / found.rate)
    np.testing.assert_allclose(lyapunov_bound.eigenvalues(record), np.linalg.eigvalsh(matrix))
    both = found + ComparisonSystem(0.5, 1.0)
    assert (both.rate, both.growth) == pytest.approx((0.5, growth + 1.0))


def test_the_envelope_solves_the_comparison_equation():
    law = ComparisonSystem(rate=0.5, growth=2.0)
    time = np.linspace(0.0, 20.0, 2001)
    envelope = law.envelope(10.0, time)
    assert envelope[0] == 10.0
    assert envelope[-1] == pytest.approx(law.bound, rel=1e-3)
    slope = np.gradient(envelope, time)
    np.testing.assert_allclose(slope[1:-1], (2.0 - 0.5 * envelope)[1:-1], atol=1e-3)


def closed_loop(parameters, start, sigma):
    """Simulate eq. (9), err1, with the law and a constant sigma (3,): 1 kHz, 10 s.

    Returns time, and rows of e, e_dot, K0..K3, zeta, theta_hat.
    """
    law, dt, steps = ModularLaw(parameters), 0.001, 10_000
    e, e_dot = np.array(start, float), np.zeros(3)
    rows = []
    for _ in range(steps):
        xi = np.sqrt(e @ e + e_dot @ e_dot)
        rows.append([*e, *e_dot, *law.adaptation[:5], *law.bias])
        tau = law.update(e, e_dot, np.zeros(3), np.array([xi, 0.0, 0.0]), False, dt)
        e_dot = e_dot + dt * (tau + sigma)
        e = e + dt * e_dot
    return dt * np.arange(steps), np.array(rows)


@pytest.mark.parametrize("leakage", [0.0, 0.05])
@pytest.mark.parametrize("law", [LAW, MENDED])
def test_v_falls_outside_the_bound_and_stays_within(law, leakage):
    law, sigma = replace(law, bias_leakage=leakage), np.array([0.6, 0.0, -0.8])
    time, rows = closed_loop(law, [3.0, -2.0, 1.0], sigma)
    # ||sigma|| = 1: K*0 bounds it, or theta takes it
    theta = sigma if law.bias_gain[0] else np.zeros(3)
    star = np.array([np.linalg.norm(sigma - theta), 0.0, 0.0, 0.0])
    gains, zeta = rows[:, 6:10], rows[:, 10]
    truth = tracking_of(rows[:, :3], rows[:, 3:6])
    parts = lyapunov_bound.parts(
        "position", law.record()[0], truth, gains, zeta, star, rows[:, 11:] - theta
    )
    coarse = lyapunov_bound.comparison(law, zeta, star, theta)
    found = stability.check(time, parts.total, coarse)
    assert np.all(parts.total > 0.0)
    assert found["start"] > 1.5 * found["bound"]
    assert found["falls_above_bound"] == 1.0
    assert found["within_bound"] == found["within_envelope"] == 1.0
    assert found["rate_inequality_holds"] == 1.0
    assert parts.total[-1] < found["bound"]
    sharper = lyapunov_bound.decrease("position", law, truth, gains, zeta, star, theta)
    assert np.all(np.gradient(parts.total, time) <= sharper + 1e-9)
    assert np.all(sharper <= -coarse.rate * parts.total + coarse.growth + 1e-9)


def test_theta_hat_takes_a_constant_coupling():
    """The printed law keeps an error; with theta_hat the error goes and theta_hat is sigma."""
    sigma = np.array([0.6, 0.0, -0.8])
    (_, printed), (_, mended) = (closed_loop(p, np.zeros(3), sigma) for p in (LAW, MENDED))
    assert np.linalg.norm(mended[-1, :3]) < 0.1 * np.linalg.norm(printed[-1, :3])
    np.testing.assert_allclose(mended[-1, 11:], sigma, atol=0.1)


def test_a_v_that_leaves_its_bound_is_reported():
    time = np.arange(100) * 0.1
    found = stability.check(time, np.exp(time), ComparisonSystem(rate=0.1, growth=1.0))
    assert found["within_bound"] == pytest.approx(np.mean(np.exp(time) <= 10.0))
    assert found["largest_ratio_to_bound"] == pytest.approx(np.exp(9.9) / 10.0)
    assert found["within_envelope"] < 0.1
    assert found["falls_above_bound"] == 0.0


@pytest.fixture(scope="module")
def analysed(direct_flight):
    """Return the analysis of a pick-and-place flight."""
    return stability.analyse(direct_flight, load_profile("s500").sets, Vehicle.load(), 0.2)


def test_a_real_flight(analysed):
    found = analysed.summary()
    assert found["V"]["within_bound"] == 1.0
    assert min(found[name]["step_inequality_holds"] for name in analysed.subsystems) > 0.99
    position, attitude, arm = (found[name] for name in ("position", "attitude", "arm"))
    # theta_hat holds the payload's weight; the autopilot compensates the arm's torque
    assert position["coupling"]["rms"][2] == pytest.approx(1.23, abs=0.1)
    assert 0.8 < position["coupling"]["adaptive_share"] < 1.1
    assert attitude["coupling"]["actuators_share"] > 0.9
    # the weight of the links is known and fed forward; the rest is the payload's
    assert 0.5 < arm["coupling"]["known_share"] < 0.6
    assert 0.8 < arm["coupling"]["adaptive_share"] < 1.1
    assert arm["coupling"]["actuators_share"] is None
    assert position["xi_max"] < position["xi_bound"]
    assert found["assumptions"]["saturated"]["position"] < 0.01
    for one in analysed.subsystems.values():
        assert np.all(one.parts.total >= 1.0)  # zeta / zeta_min alone
        assert np.all(one.parts.tracking >= 0.0)


def test_sigma_satisfies_the_error_equation(analysed, direct_flight):
    """Eq. (9), err1: Mbar chi_ddot = tau + Mbar sigma, tau without known loads."""
    force = analysed.supply.tau - analysed.supply.known
    inertia = nominal_inertia(load_profile("s500").sets)
    acceleration = analysed.coupling.sigma + force / inertia
    true = direct_flight.block("truth.")[analysed.rows, 16:24]
    np.testing.assert_allclose(acceleration, true, atol=1e-6)
    regressors = constants.regressor(analysed.truth)
    for name, one in analysed.subsystems.items():
        sigma = analysed.coupling.sigma[:, COLUMNS_OF[name]]
        for star, theta in ((one.constants, one.theta), (one.printed, 0.0)):
            bound = regressors @ star
            assert np.all(np.linalg.norm(sigma - theta, axis=1) <= bound * (1 + 1e-9))


def test_figures_of_a_flight_of_three_seconds(short_direct_flight, tmp_path):
    found = stability.analyse(short_direct_flight, load_profile("s500").sets, Vehicle.load(), 0.2)
    flight = panels.DrawnFlight("modular", short_direct_flight, found)
    names = ["lyapunov", "coupling"]
    assert figures.draw([flight], tmp_path, names=names) == names
    assert figures.draw([flight, flight], tmp_path / "two", names=names) == []
    assert figures.draw([replace(flight, stability=None)], tmp_path / "no", names=names) == []


def test_no_analysis_of_other_laws_and_of_a_vehicle_on_the_ground(short_direct_flight, tmp_path):
    series, sets = short_direct_flight, load_profile("s500").sets
    values = series.values.copy()
    values[:, COLUMNS.block("adaptation.")] = np.nan
    other = Series(
        values, series.phases, series.phase_names, {"controller": "asmc1"}, series.columns
    )
    assert analyse_folder(tmp_path, other) is None
    assert stability.analyse(other, sets, Vehicle.load(), 0.2) is None
    rows = series.time < 0.2
    grounded = Series(
        series.values[rows], series.phases[rows], series.phase_names, series.info, series.columns
    )
    assert stability.analyse(grounded, sets, Vehicle.load(), 0.2) is None
    empty = Series(series.values[:0], series.phases[:0], series.phase_names, {}, series.columns)
    assert len(tracking.in_the_air(empty)) == 0
