"""Closed curves and minimum snap: shapes, timing, consistent derivatives."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.mission.scenarios import curves
from uam_control.mission.scenarios.reference_kinds import minimum_snap, shares

MIDDLE = np.array([0.5, -0.5, 1.2, 0.0, 0.0, 0.25, 0.0, 1.5])


def flown(shape, theta, **options):
    path = curves.follow(shape, theta, MIDDLE, **options)
    times = np.linspace(0.0, path.length, 20001)
    return times, path.rows(times)


def assert_consistent(times, rows):
    """Each row is the derivative of the row before, by the trapezoidal rule."""
    step = times[1] - times[0]
    for lower, upper in zip(rows[:-1, 1:-1], rows[1:, 1:-1], strict=True):
        difference = np.diff(lower, axis=0) / step - (upper[1:] + upper[:-1]) / 2.0
        assert np.abs(difference).max() <= 1e-3 * (1.0 + np.abs(upper).max())


def test_a_circle_at_speed():
    theta = curves.steady(3.0, math.pi, 3.0)  # 1 m radius, 2 m/s
    times, rows = flown(curves.circle(1.0), theta)
    assert theta.length == pytest.approx(3 * math.pi + 3)
    away = rows[0, :, :2] - MIDDLE[:2]
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), 1.0, atol=1e-9)
    steady = (times > 3.01) & (times < theta.length - 3.01)
    np.testing.assert_allclose(np.linalg.norm(rows[1, steady, :2], axis=1), 2.0, atol=1e-8)
    np.testing.assert_allclose(np.linalg.norm(rows[2, steady, :2], axis=1), 4.0, atol=1e-7)
    assert np.linalg.norm(rows[1], axis=1).max() <= 2.0 + 1e-9
    np.testing.assert_allclose(rows[0, [0, -1], :3], [[1.5, -0.5, 1.2]] * 2, atol=1e-9)
    assert_consistent(times, rows)


def test_a_lemniscate_has_its_size_and_begins_in_its_middle():
    times, rows = flown(curves.lemniscate(2.0, 1.0), curves.steady(2.0, 8.0, 3.0))
    away = rows[0, :, :2] - MIDDLE[:2]
    np.testing.assert_allclose(np.ptp(away, axis=0), [2.0, 1.0], atol=1e-5)
    np.testing.assert_allclose(away[[0, -1]], 0.0, atol=1e-9)
    assert_consistent(times, rows)


def test_the_ellipse_of_the_issue_needs_42_newtons_and_turns_yaw():
    theta = curves.swept(2.25, 14.5)
    times, rows = flown(curves.ellipse(10.0, 5.0), theta, tangent=True)
    thrust = 2.2 * np.linalg.norm(rows[2, :, :3] + [0.0, 0.0, 9.81], axis=1)
    assert thrust.max() == pytest.approx(42.23, abs=0.01)
    assert rows[0, -1, 5] - rows[0, 0, 5] == pytest.approx(2.25 * 2.0 * math.pi)
    moving = np.linalg.norm(rows[1, :, :2], axis=1) > 0.1
    heading = np.arctan2(rows[1, moving, 1], rows[1, moving, 0])
    np.testing.assert_allclose(np.cos(heading - rows[0, moving, 5]), 1.0, atol=1e-9)
    assert_consistent(times[5:-5], rows[:, 5:-5])


def test_yaw_may_turn_and_height_may_rise_on_its_own():
    shape = (*curves.circle(1.0), *curves.rise(0.5))
    times, rows = flown(shape, curves.steady(2.0, 6.0, 3.0), yaw_turns=0.5)
    assert rows[0, -1, 5] - rows[0, 0, 5] == pytest.approx(2.0 * math.pi)
    assert np.ptp(rows[0, :, 2]) == pytest.approx(0.5, abs=1e-6)
    assert rows[0, 0, 2] == pytest.approx(1.2 - 0.25)
    assert_consistent(times, rows)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.5, 5), st.floats(0.5, 5), st.floats(2, 12), st.floats(1, 4), st.booleans())
def test_every_curve_is_smooth(length, width, period, laps, tangent):
    theta = curves.steady(laps, period, min(3.0, laps * period))
    times, rows = flown(curves.ellipse(length, width), theta, tangent=tangent)
    if not tangent or max(length / width, width / length) < 2.0:  # else yaw turns abruptly
        assert_consistent(times, rows)
    np.testing.assert_allclose(rows[1:, [0, -1]], 0.0, atol=1e-9)


def test_minimum_snap_of_one_piece_is_the_rest_to_rest_septic():
    path = minimum_snap(np.array([0.0, 2.0]), np.array([[0.0], [3.0]]))
    # 35 u^4 - 84 u^5 + 70 u^6 - 20 u^7
    np.testing.assert_allclose(
        path.coefficients[0, :, 0], 3.0 * np.array([0, 0, 0, 0, 35, -84, 70, -20]), atol=1e-9
    )


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-3, 3)] * 3), min_size=2, max_size=7, unique=True))
def test_minimum_snap_passes_its_points_smoothly(points):
    points = np.array(points)
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if gaps.min() < 0.3:
        return
    times = 5.0 * shares(points)
    path = minimum_snap(times, points)
    rows = path.rows(times)
    np.testing.assert_allclose(rows[0], points, atol=1e-6)
    fine = np.linspace(0.0, times[-1], 20001)
    assert_consistent(fine, path.rows(fine)[:4])
    for end in path.ends():
        np.testing.assert_allclose(end[1:4], 0.0, atol=1e-6)


def test_times_between_points_are_in_proportion_to_the_roots_of_the_distances():
    along = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 1.0, 0.0]])
    np.testing.assert_allclose(shares(along), [0.0, 1 / 3, 2 / 3, 1.0], atol=1e-12)


def test_the_curve_stays_near_points_that_are_unequally_far_apart():
    points = np.array(
        [[-1.0, 0.5, 1.2], [-0.2, 1.2, 1.9], [0.2, 1.2, 1.2], [1.9, 0.4, 2.1], [-1.8, 1.5, 1.5]]
    )
    places = minimum_snap(shares(points), points).rows(np.linspace(0.0, 1.0, 500))[0]
    beyond = np.maximum(
        places.max(axis=0) - points.max(axis=0), points.min(axis=0) - places.min(axis=0)
    )
    assert beyond.max() < 1.0  # 4.5 m with times in proportion to the distances


def test_minimum_snap_has_less_snap_than_a_neighbour():
    points = np.array([[0.0], [2.0], [1.0]])

    def cost(middle_time):
        path = minimum_snap(np.array([0.0, middle_time, 4.0]), points)
        return np.mean(path.rows(np.linspace(1e-6, 4.0 - 1e-6, 4001))[4] ** 2)

    # against a curve through the same points at the same times, made of two stops
    from uam_control.mission.motion.polynomials import joined

    stops = joined([minimum_snap(np.array([0.0, 2.0]), points[i : i + 2]) for i in (0, 1)])
    stopped = np.mean(stops.rows(np.linspace(1e-6, 4.0 - 1e-6, 4001))[4] ** 2)
    assert cost(2.0) < 0.5 * stopped
