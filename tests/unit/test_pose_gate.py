"""Poses that jump: which are rejected, for how long, and the error of the estimate."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.ages import REJECTED
from uam_control.estimation import EstimatorParameters, StateEstimator
from uam_control.estimation.pose_clock import new_gate, rejects, settled, suspend

PERIOD, TICK = 0.008, 0.004
LEVEL, WEIGHT = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 9.81])


class Gate:
    """A gate that rejects poses more than 0.4 m away."""

    def __init__(self) -> None:
        self.memory = new_gate()
        self.memory["distance"] = 0.4

    def __call__(self, stamp: float, distance: float, bias: float) -> bool:
        return rejects(self.memory, stamp, distance, bias, REJECTED)

    @property
    def refused(self) -> int:
        return self.memory["refused"].item()


def refusals(gate: Gate, distances: list[float], bias: float = 0.0, begin: float = 0.0):
    return [gate(begin + PERIOD * k, d, bias) for k, d in enumerate(distances)]


def after_a_while() -> Gate:
    """Return a gate after poses until 0 s, long enough for it to be active."""
    gate = Gate()
    assert not any(refusals(gate, [0.0] * 200, begin=-200 * PERIOD))
    return gate


def test_only_poses_far_from_the_estimate_are_rejected_and_counted():
    gate = after_a_while()
    assert refusals(gate, [0.01, 0.5, 0.39, 0.7, 0.7, 0.02]) == [0, 1, 0, 1, 1, 0]
    assert gate.refused == 3


def answers(gate: Gate, poses: list[tuple[float, float]], bias: float = 0.0) -> list[bool]:
    """Return the gate's results for (stamp [s], distance [m])."""
    return [gate(stamp, distance, bias) for stamp, distance in poses]


def quarters(begin: float, end: float) -> list[tuple[float, float]]:
    """Return poses equal to the estimate, one per 0.25 s (exact in binary) in [begin, end)."""
    return [(float(stamp), 0.0) for stamp in np.arange(begin, end, 0.25)]


def test_the_estimate_is_trusted_when_poses_have_come_for_more_than_a_second():
    gate = Gate()
    assert not any(answers(gate, [*quarters(0.0, 1.0), (1.0, 0.5)]))
    assert answers(gate, [(1.25, 0.4), (1.25, 0.5)]) == [False, True]


def test_a_gap_of_more_than_half_a_second_ends_the_trust():
    gate = Gate()
    answers(gate, quarters(0.0, 2.0))  # the last one at 1.75 s
    assert answers(gate, [(2.25, 0.5), (3.0, 0.5), (3.5, 0.5)]) == [True, False, False]
    assert answers(gate, [(4.0, 0.0), (4.25, 0.5)]) == [False, True]  # more than 1 s after 3 s


@pytest.mark.parametrize(("bias", "refused"), [(1.0, True), (1.5, False)])
def test_a_bias_of_more_than_1_m_per_s2_ends_the_trust(bias, refused):
    gate = Gate()
    answers(gate, quarters(0.0, 2.0))
    assert answers(gate, [(2.0, 0.5)], bias) == [refused]
    gate = Gate()  # a bias that grows during a rejection does not end it
    answers(gate, quarters(0.0, 2.0))
    assert answers(gate, [(2.0, 0.5)]) + answers(gate, [(2.25, 0.5)], bias) == [True, True]


def test_biases_are_unsettled_for_a_second_after_a_gap_but_not_by_a_contradiction():
    gate = Gate()
    answers(gate, quarters(0.0, 2.0))
    # the start is the end of a gap
    assert not settled(gate.memory, 1.0) and settled(gate.memory, 1.25)
    answers(gate, [(2.0, 0.0)], bias=1.5)
    assert settled(gate.memory, 2.0)
    suspend(gate.memory, 2.25)  # a gap of the IMU
    assert not settled(gate.memory, 3.25) and settled(gate.memory, 3.5)


def test_poses_are_refused_for_ten_seconds_and_then_followed_for_more_than_one():
    gate = Gate()
    answers(gate, quarters(0.0, 2.0))
    far = [(stamp, 0.5) for stamp, _ in quarters(2.0, 14.0)]
    # refused from 2 to 12 s, used from 12.25 to 13.25 s (five), then refused again
    assert answers(gate, far) == [True] * 41 + [False] * 5 + [True] * 2
    assert gate.refused == 43


def test_wrong_poses_that_pass_through_the_true_place_do_not_count():
    gate = after_a_while()
    # exchanged axes: off for 0.2 s, near for 0.08 s, off again, and right from 0.48 s on
    wrong = [0.5] * 25 + [0.1] * 10 + [0.7] * 25
    assert all(refusals(gate, wrong))
    right = refusals(gate, [0.0] * 100, begin=60 * PERIOD)
    assert right == [True] * 63 + [False] * 37  # refused for 0.5 s = 62.5 poses
    # a few wrong ones cost nothing
    assert not any(refusals(gate, [0.5] * 10 + [0.0] * 10, begin=160 * PERIOD)[10:])


def test_no_rejection_while_the_imu_contradicts_the_estimate():
    gate = after_a_while()
    assert not any(refusals(gate, [0.02] * 5, bias=1.1))
    assert not any(refusals(gate, [0.7] * 100, begin=5 * PERIOD))  # for a second
    assert gate(5 * PERIOD + 1.0, 0.7, 0.0)


def test_no_rejection_after_a_gap_of_poses_or_imu():
    gate = after_a_while()
    assert gate(0.3, 0.7, 0.0)
    assert not any(gate(1.0 + PERIOD * k, 0.7, 0.0) for k in range(100))
    gate = after_a_while()
    suspend(gate.memory, 0.0)
    assert not any(gate(PERIOD * k, 0.7, 0.0) for k in range(100))
    assert gate(1.1, 0.7, 0.0)


@given(st.lists(st.floats(0.0, 10.0), min_size=400, max_size=400), st.floats(0.05, 10.0))
def test_no_rejection_is_longer_than_its_limit(distances, limit):
    gate = after_a_while()
    gate.memory["distance"] = limit
    refused = answers(gate, [(0.04 * k, distance) for k, distance in enumerate(distances)])
    longest = round(REJECTED / 0.04) + 1
    assert all(not all(refused[k : k + longest + 1]) for k in range(len(refused) - longest))


def hover(jump: np.ndarray, seconds: float) -> tuple[StateEstimator, float]:
    """Run an estimator of a vehicle at rest whose poses jump by `jump` at 1.5 s for `seconds`.

    Returns the estimator and its largest position error [m] until a second after the jump.
    """
    estimator, worst = StateEstimator(EstimatorParameters(), 2), 0.0
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
    estimator, worst = hover(np.array([1.0, 0.0, 0.0]), REJECTED + 0.5)
    assert worst > 0.9
    np.testing.assert_allclose(estimator.update()[0, :3], 0.0, atol=0.05)
