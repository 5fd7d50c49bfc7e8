"""Piecewise polynomials: values worked by hand, continuity, times."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.mission.motion.polynomials import (
    PEAK_ACCELERATION,
    PEAK_RATE,
    ROWS,
    Polynomials,
    hermite,
    joined,
    ramp_up,
    rest_to_rest,
    reversed_in_time,
)

# x = 1 + 2 u + 3 u^2 over 2 s, then 6 + 8 u + 5 u^2 over 4 s
TWO = Polynomials(
    np.array([1.0, 3.0, 7.0]), np.array([[[1.0], [2.0], [3.0]], [[6.0], [8.0], [5.0]]])
)


def written(curve, time, rows=ROWS):
    reference = np.full((rows, curve.coefficients.shape[2]), np.nan)
    curve.write(time, reference)
    return reference


def test_value_and_derivatives_in_an_interval():
    # at 2 s u = 1/2: 1 + 1 + 3/4, (2 + 3) / 2, 6 / 4
    np.testing.assert_allclose(written(TWO, 2.0)[:, 0], [2.75, 2.5, 1.5, 0.0, 0.0])
    # at 6 s u = 3/4: 6 + 6 + 45/16, (8 + 7.5) / 4, 10 / 16
    np.testing.assert_allclose(written(TWO, 6.0)[:, 0], [14.8125, 3.875, 0.625, 0.0, 0.0])
    np.testing.assert_allclose(written(TWO, 6.0, rows=3)[:, 0], [14.8125, 3.875, 0.625])


def test_before_and_after_it_is_at_rest():
    for time, value in ((-5.0, 1.0), (1.0, 1.0), (7.0, 19.0), (99.0, 19.0)):
        assert written(TWO, time)[:, 0].tolist() == [value, 0.0, 0.0, 0.0, 0.0]
    assert TWO.first == [1.0] and TWO.last == [19.0] and TWO.length == 6.0
    begin, end = TWO.ends()
    np.testing.assert_allclose(begin[:, 0], [1.0, 1.0, 1.5, 0.0, 0.0])
    np.testing.assert_allclose(end[:, 0], [19.0, 4.5, 0.625, 0.0, 0.0])


def test_slower_later_and_one_after_the_other():
    slow = TWO.slowed(2.0)
    np.testing.assert_allclose(written(slow, 3.0)[:3, 0], [2.75, 1.25, 0.375])
    moved = TWO.shifted(10.0, np.array([100.0]))
    np.testing.assert_allclose(written(moved, 12.0)[:2, 0], [102.75, 2.5])
    both = joined([TWO, slow.shifted(50.0)])
    assert both.length == 18.0
    np.testing.assert_allclose(written(both, 1.0)[:3, 0], [2.75, 2.5, 1.5])
    np.testing.assert_allclose(written(both, 8.0)[:3, 0], [2.75, 1.25, 0.375])


@given(st.lists(st.floats(-5, 5), min_size=2 * ROWS, max_size=2 * ROWS), st.floats(0.2, 5))
def test_hermite_passes_value_rate_acceleration_jerk_and_snap(numbers, length):
    rows = np.array(numbers).reshape(ROWS, 2, 1)
    curve = hermite(np.array([2.0, 2.0 + length]), rows)
    begin, end = curve.ends()
    np.testing.assert_allclose(begin[:, 0], rows[:, 0, 0], atol=1e-7)
    np.testing.assert_allclose(end[:, 0], rows[:, 1, 0], rtol=1e-6, atol=1e-4 * (1 + length**-4))


def test_the_move_from_rest_to_rest_has_the_stated_peaks():
    curve = rest_to_rest(np.array([1.0]), np.array([3.0]), 4.0)
    rows = curve.rows(np.linspace(0.0, 4.0, 20001))
    np.testing.assert_allclose(rows[0, [0, 10000, -1], 0], [1.0, 2.0, 3.0], atol=1e-12)
    assert np.abs(rows[1]).max() == pytest.approx(PEAK_RATE * 2.0 / 4.0)
    assert np.abs(rows[2]).max() == pytest.approx(PEAK_ACCELERATION * 2.0 / 16.0, rel=1e-4)
    for end in curve.ends():
        np.testing.assert_allclose(end[1:], 0.0, atol=1e-9)


def test_a_ramp_begins_at_rest_and_reaches_everything():
    goal = np.array([[1.0, 0.0], [2.0, -1.0], [-3.0, 0.5], [4.0, 0.0], [5.0, 1.0]])
    ramp = ramp_up(goal, 2.0)
    begin, end = ramp.ends()
    np.testing.assert_allclose(begin[1:], 0.0, atol=1e-12)
    np.testing.assert_allclose(end, goal, atol=1e-9)
    # without acceleration the ramp of the speed is symmetric: half the way of the full speed
    plain = ramp_up(np.array([[7.0], [3.0], [0.0], [0.0], [0.0]]), 2.0)
    assert plain.first[0] == pytest.approx(7.0 - 3.0)


def test_flown_backwards_odd_derivatives_change_their_sign():
    ramp = ramp_up(np.array([[1.0], [2.0], [-3.0], [4.0], [5.0]]), 2.0)
    begin, end = reversed_in_time(ramp).ends()
    np.testing.assert_allclose(begin[:, 0], [1.0, -2.0, -3.0, -4.0, 5.0], atol=1e-9)
    np.testing.assert_allclose(end[1:], 0.0, atol=1e-9)
