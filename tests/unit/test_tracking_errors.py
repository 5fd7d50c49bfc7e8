"""e, e_dot, the feedforward and the norms against numbers worked out by hand.

Angles are those of the 3-4-5 triangle: A has cosine 0.8 and sine 0.6, B the other way round.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from uam_control.laws.errors import tracking_errors

A, B = math.atan2(0.6, 0.8), math.atan2(0.8, 0.6)
NONE = np.zeros((3, 3))


def vehicle(joints: int = 2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State and reference (3, 6 + joints), attitude reference (3, 3), all zero."""
    return np.zeros((3, 6 + joints)), np.zeros((3, 6 + joints)), np.zeros((3, 3))


def errors_of(state, reference, attitude_reference=NONE, flying=True, printed=False):
    """What `tracking_errors` writes; the arrays hold something else before."""
    errors, norms = np.full(state.shape, 77.0), np.full(3, 77.0)
    tracking_errors(state, reference, attitude_reference, flying, printed, errors, norms)
    return errors, norms


def test_position_rows():
    state, reference, _ = vehicle()
    state[:, :3] = (1.0, 2.0, 3.0), (0.5, -0.5, 0.25), (9.0, 9.0, 9.0)
    reference[:, :3] = (0.5, 4.0, 2.0), (0.25, 0.5, -1.0), (0.1, -0.2, 0.3)
    errors, _ = errors_of(state, reference)
    np.testing.assert_array_equal(errors[0, :3], [0.5, -2.0, 1.0])
    np.testing.assert_array_equal(errors[1, :3], [0.25, -1.0, 1.25])
    np.testing.assert_array_equal(errors[2, :3], [0.1, -0.2, 0.3])  # of the reference, not 9
    np.testing.assert_array_equal(errors[:, 3:], 0.0)


@pytest.mark.parametrize("flying", [True, False])
@pytest.mark.parametrize("joints", [1, 2, 3])
def test_arm_rows_of_any_number_of_joints_in_flight_and_on_the_ground(joints, flying):
    state, reference, _ = vehicle(joints)
    count = np.arange(1.0, joints + 1.0)
    state[:, 6:] = 2.0 * count, 3.0 * count, 9.0 * count
    reference[:, 6:] = 0.5 * count, 1.0 * count, 0.25 * count
    errors, _ = errors_of(state, reference, flying=flying)
    np.testing.assert_array_equal(errors[:, 6:], [1.5 * count, 2.0 * count, 0.25 * count])
    np.testing.assert_array_equal(errors[:, :6], 0.0)


def test_on_the_ground_position_and_attitude_have_no_errors():
    state, reference, attitude_reference = vehicle()
    state[:], attitude_reference[:] = 0.3, 0.2
    errors, norms = errors_of(state, reference, attitude_reference, flying=False)
    np.testing.assert_array_equal(errors[:, :6], 0.0)
    # xi: two joints, 0.3 in angle and rate each; the other norms are of the whole vehicle
    np.testing.assert_allclose(norms, [0.3 * 2.0, 0.3 * math.sqrt(8.0), 0.3 * math.sqrt(8.0)])


def test_attitude_rows_of_a_yaw_error():
    # R_d = I, R = Rz(A): R_d^T R = [[.8 -.6 0] [.6 .8 0] [0 0 1]], e_q = (0, 0, .6)
    state, reference, desired = vehicle()
    state[0, 5], state[1, 3:6] = A, (1.0, 2.0, 3.0)
    desired[1], desired[2] = (0.5, -1.0, 2.0), (10.0, 5.0, -4.0)
    # R^T R_d Omega_d = (.8*.5 - .6, -.6*.5 - .8, 2) = (-.2, -1.1, 2)
    # R^T R_d Omega_d_dot = (8 + 3, -6 + 4, -4) = (11, -2, -4)
    # Omega x (-.2, -1.1, 2) = (2*2 + 3*1.1, -3*.2 - 1*2, -1.1 + 2*.2) = (7.3, -2.6, -.7)
    errors, _ = errors_of(state, reference, desired)
    np.testing.assert_allclose(errors[0, 3:6], [0.0, 0.0, 0.6], atol=1e-15)
    np.testing.assert_allclose(errors[1, 3:6], [1.2, 3.1, 1.0])
    np.testing.assert_allclose(errors[2, 3:6], [11.0 - 7.3, -2.0 + 2.6, -4.0 + 0.7])
    # printed: R_d^T R Omega_d = (.8*.5 + .6, .6*.5 - .8, 2) = (1, -.5, 2); Omega_d_dot as it is
    errors, _ = errors_of(state, reference, desired, printed=True)
    np.testing.assert_allclose(errors[0, 3:6], [0.0, 0.0, 0.6], atol=1e-15)
    np.testing.assert_allclose(errors[1, 3:6], [0.0, 2.5, 1.0], atol=1e-15)
    np.testing.assert_allclose(errors[2, 3:6], [10.0, 5.0, -4.0])


def test_attitude_rows_of_a_rolled_vehicle_that_should_be_pitched():
    # R = Rx(B), R_d = Ry(A): R_d^T R = [[.8 -.48 -.36] [0 .6 -.8] [.6 .64 .48]]
    # e_q = 1/2 (.64 + .8, -.36 - .6, 0 + .48)
    state, reference, desired = vehicle()
    state[0, 3], desired[0, 1] = B, A
    desired[1], desired[2] = (1.0, 2.0, 3.0), (2.0, 0.5, -1.0)
    state[1, 3:6] = 0.1, -0.2, 0.3
    # R^T R_d Omega_d = (.8 + 1.8, -.48 + 1.2 + 1.92, -.36 - 1.6 + 1.44) = (2.6, 2.64, -.52)
    # R^T R_d Omega_d_dot = (1.6 - .6, -.96 + .3 - .64, -.72 - .4 - .48) = (1, -1.3, -1.6)
    # Omega x (2.6, 2.64, -.52)
    #   = (.2*.52 - .3*2.64, .3*2.6 + .1*.52, .1*2.64 + .2*2.6) = (-.688, .832, .784)
    errors, _ = errors_of(state, reference, desired)
    np.testing.assert_allclose(errors[0, 3:6], [0.72, -0.48, 0.24])
    np.testing.assert_allclose(errors[1, 3:6], [0.1 - 2.6, -0.2 - 2.64, 0.3 + 0.52])
    np.testing.assert_allclose(errors[2, 3:6], [1.688, -2.132, -2.384])
    # printed: R_d^T R Omega_d = (.8 - .96 - 1.08, 1.2 - 2.4, .6 + 1.28 + 1.44)
    errors, _ = errors_of(state, reference, desired, printed=True)
    np.testing.assert_allclose(errors[1, 3:6], [0.1 + 1.24, -0.2 + 1.2, 0.3 - 3.32])
    np.testing.assert_allclose(errors[2, 3:6], [2.0, 0.5, -1.0])


def test_yaw_on_both_sides_of_pi():
    # -170 and 170 degrees are 20 degrees apart: e_z = sin 20 = 0.342
    state, reference, desired = vehicle()
    state[0, 5], desired[0, 2] = math.radians(-170.0), math.radians(170.0)
    errors, _ = errors_of(state, reference, desired)
    assert errors[0, 5] == pytest.approx(0.3420201433)


def test_the_attitude_of_the_reference_does_not_count_but_that_of_the_position_controller():
    state, reference, _ = vehicle()
    reference[:, 3:6] = 5.0
    errors, norms = errors_of(state, reference)
    np.testing.assert_array_equal(errors, 0.0)
    np.testing.assert_array_equal(norms, 0.0)


def test_norms_are_of_position_attitude_and_arm_together():
    state, reference, desired = vehicle()
    state[0] = 2.0, 0.0, -1.0, 0.0, 0.0, A, 1.0, -2.0
    state[1] = 1.0, 2.0, -2.0, 0.0, 3.0, 0.0, -1.0, 4.0
    state[2] = 0.0, 3.0, 4.0, 12.0, 0.0, 0.0, 84.0, 0.0
    reference[0, 0], reference[1, 7], reference[2] = 1.0, 2.0, 55.0
    errors, norms = errors_of(state, reference, desired)
    np.testing.assert_allclose(errors[0], [1.0, 0.0, -1.0, 0.0, 0.0, 0.6, 1.0, -2.0], atol=1e-15)
    np.testing.assert_allclose(errors[1], [1.0, 2.0, -2.0, 0.0, 3.0, 0.0, -1.0, 2.0], atol=1e-15)
    # e: 1 + 1 + .36 + 1 + 4 = 7.36; e_dot: 1 + 4 + 4 + 9 + 1 + 4 = 23; their sum is 30.36
    # chi_ddot: 9 + 16 + 144 + 7056 = 7225 = 85^2; chi_dot: 1 + 4 + 4 + 9 + 1 + 16 = 35
    np.testing.assert_allclose(norms, [math.sqrt(30.36), 85.0, math.sqrt(35.0)])


def test_xi_counts_the_attitude_error_on_so3_and_its_rate_in_either_form():
    # the rolled vehicle from above: e_q . e_q = .5184 + .2304 + .0576 = .8064
    state, reference, desired = vehicle()
    state[0, 3], desired[0, 1] = B, A
    desired[1] = 1.0, 2.0, 3.0
    # Omega = 0: e_q_dot is -(2.6, 2.64, -.52), and printed -(-1.24, -1.2, 3.32); both |.|^2 = 14
    for printed in (False, True):
        _, norms = errors_of(state, reference, desired, printed=printed)
        np.testing.assert_allclose(norms, [math.sqrt(14.8064), 0.0, 0.0])
