"""Poses that jump: which are not used, for how long, and what the estimate makes of it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.estimation import EstimatorParameters, StateEstimator
from uam_control.estimation.pose_gate import CONTRADICTED, LONGEST, MEMORY, PoseGate

PERIOD, TICK = 0.008, 0.004
LEVEL, WEIGHT = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 9.81])


def refusals(gate: PoseGate, distances: list[float], bias: float = 0.0, begin: float = 0.0):
    return [gate(begin + PERIOD * k, d, bias) for k, d in enumerate(distances)]


def after_a_while() -> PoseGate:
    """One that has seen poses until 0 s, long enough to trust the estimate."""
    gate = PoseGate(0.4)
    assert not any(refusals(gate, [0.0] * 200, begin=-200 * PERIOD))
    return gate


def test_only_what_is_far_from_the_estimate_is_refused_and_is_counted():
    gate = after_a_while()
    assert refusals(gate, [0.01, 0.5, 0.39, 0.7, 0.7, 0.02]) == [0, 1, 0, 1, 1, 0]
    assert gate.refused == 3


def test_an_estimate_that_the_imu_contradicts_refuses_nothing():
    gate = after_a_while()
    assert not any(refusals(gate, [0.02] * 5, bias=1.1 * CONTRADICTED))
    assert not any(refusals(gate, [0.7] * 100, begin=5 * PERIOD))  # within MEMORY
    assert gate(5 * PERIOD + MEMORY, 0.7, 0.0)


def test_nor_does_one_that_may_be_off_after_a_gap_of_poses_or_imu():
    gate = after_a_while()
    assert gate(0.3, 0.7, 0.0)
    assert not any(gate(1.0 + PERIOD * k, 0.7, 0.0) for k in range(100))
    gate = after_a_while()
    gate.doubt(0.0)
    assert not any(gate(PERIOD * k, 0.7, 0.0) for k in range(100))
    assert gate(MEMORY + 0.1, 0.7, 0.0)


@given(st.lists(st.floats(0.0, 10.0), min_size=400, max_size=400), st.floats(0.05, 10.0))
def test_nothing_is_refused_for_longer_than_it_helps(distances, limit):
    gate = after_a_while()
    gate.distance = limit
    refused = refusals(gate, distances)
    longest = round(LONGEST / PERIOD) + 1
    assert all(not all(refused[k : k + longest + 1]) for k in range(len(refused) - longest))


def hover(jump: np.ndarray, seconds: float) -> tuple[StateEstimator, float]:
    """An estimator of a vehicle at rest, whose poses jump at 1.5 s for so long; the largest
    error [m] of its position until a second later."""
    estimator, worst = StateEstimator(EstimatorParameters()), 0.0
    for k in range(round((2.5 + seconds) / TICK)):
        t = TICK * k
        if k % 2 == 0:
            noise = 1e-4 * np.array([np.sin(37.0 * k), np.cos(53.0 * k), np.sin(71.0 * k)])
            estimator.mocap(t, noise + (jump if 1.5 <= t < 1.5 + seconds else 0.0), LEVEL)
        estimator.joints(t, np.zeros(2), np.zeros(2))
        estimator.imu(t, np.zeros(3), WEIGHT)
        worst = max(worst, float(np.linalg.norm(estimator.update()[0, :3])))
    return estimator, worst


@pytest.mark.parametrize(("jump", "followed"), [(0.1, True), (0.2, False), (3.0, False)])
def test_the_estimate_follows_a_small_jump_and_waits_for_the_end_of_a_large_one(jump, followed):
    estimator, worst = hover(np.array([jump, 0.0, 0.0]), 1.5)
    assert (worst > 0.9 * jump) is followed
    assert followed or worst < 0.02
    assert (estimator.refused_poses == 0) is followed


def test_a_jump_that_stays_is_accepted_in_the_end():
    estimator, worst = hover(np.array([1.0, 0.0, 0.0]), LONGEST + 0.5)
    assert worst > 0.9
    np.testing.assert_allclose(estimator.update()[0, :3], 0.0, atol=0.05)
