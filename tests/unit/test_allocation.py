"""Allocation: PX4's normalisation, exactness inside the limits, priorities at the limits."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.vehicle.rotor_geometry import normalised_mixer, thrust_coefficient, torque_scale
from uam_sim_bridge.autopilot.cycle import allocate, unallocated_torque

PX = np.array([0.171, -0.171, 0.171, -0.171])
PY = np.array([0.171, -0.171, -0.171, 0.171])
KM = np.array([0.016, 0.016, -0.016, -0.016])
MIXER = normalised_mixer(PX, PY, KM)
INVERSE = np.linalg.pinv(MIXER)
HALF = math.sqrt(0.5)


def run(roll, pitch, yaw, thrust):
    motors = np.zeros(4)
    allocate(np.array([roll, pitch, yaw]), thrust, MIXER, motors)
    return motors


@pytest.mark.parametrize(("moment_ratio", "coefficient"), [(0.016, 6.5), (0.005, 20.0)])
def test_px4_controls_the_yaw_of_rotors_with_little_torque(moment_ratio, coefficient):
    """6.5 * 0.016 m = 0.104 is enough, 6.5 * 0.005 m = 0.033 is not above 0.05."""
    assert thrust_coefficient(moment_ratio) == pytest.approx(coefficient)


def test_mixer_of_the_square_quad():
    """Front-right, back-left (CCW), front-left, back-right (CW); FRD torques."""
    expected = [
        [-HALF, HALF, 1.0, 1.0],
        [HALF, -HALF, 1.0, 1.0],
        [HALF, HALF, -1.0, 1.0],
        [-HALF, -HALF, -1.0, 1.0],
    ]
    assert pytest.approx(np.array(expected)) == MIXER


def test_mixer_of_a_plus_whose_rotors_are_a_little_off_the_axes():
    """Two rotors of four make a torque each: sqrt(1/2). Entries below 0.001 are zero."""
    off = 1e-4
    px, py = np.array([1.0, -1.0, off, -off]), np.array([off, -off, 1.0, -1.0])
    found = normalised_mixer(px, py, np.array([0.1, 0.1, -0.1, -0.1]))
    expected = np.array(
        [
            [0.0, HALF, 1.0, 1.0],
            [0.0, -HALF, 1.0, 1.0],
            [-HALF, 0.0, -1.0, 1.0],
            [HALF, 0.0, -1.0, 1.0],
        ]
    )
    assert found == pytest.approx(expected, abs=1e-6)
    np.testing.assert_array_equal(found == 0.0, expected == 0.0)


def test_mixer_does_not_depend_on_the_size():
    assert normalised_mixer(3 * PX, 3 * PY, 0.5 * KM) == pytest.approx(MIXER)


def test_torque_scale_by_hand():
    # 4 rotors, each sqrt(1/2) of 10.34 N at 0.171 m; 4 rotors at 0.016 m
    assert torque_scale(PX, PY, KM, 10.34) == pytest.approx(
        [4 * HALF * 10.34 * 0.171, 4 * HALF * 10.34 * 0.171, 4 * 10.34 * 0.016]
    )


def test_singular_geometry_is_refused():
    with pytest.raises(ValueError, match="independently"):
        normalised_mixer(np.zeros(4), PY, KM)


@given(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(0.3, 0.7))
def test_exact_where_nothing_saturates(roll, pitch, yaw, thrust):
    motors = run(roll, pitch, yaw, thrust)
    assert INVERSE @ motors == pytest.approx([roll, pitch, yaw, thrust], abs=1e-12)


@given(*[st.floats(-3.0, 3.0)] * 3, st.floats(0.0, 1.0))
def test_motors_stay_in_range_and_collective_is_not_raised(roll, pitch, yaw, thrust):
    motors = run(roll, pitch, yaw, thrust)
    assert np.all((motors >= 0.0) & (motors <= 1.0))
    if roll == pitch == yaw == 0.0:
        assert motors == pytest.approx(np.full(4, thrust))


def test_no_thrust_no_torque():
    """Without airmode the torques go when the thrust is zero."""
    assert run(0.4, 0.2, 0.0, 0.0) == pytest.approx(np.zeros(4), abs=1e-12)


def test_roll_is_kept_before_yaw_at_full_thrust():
    motors = run(0.2, 0.0, 1.0, 1.0)
    roll, _, yaw, thrust = INVERSE @ motors
    assert roll > 0.1
    assert 0.0 < yaw < 0.6
    assert thrust < 1.0


def test_unallocated_torque_has_the_sign_of_what_is_missing():
    torque = np.array([2.0, 0.0, -0.05])
    out = np.zeros(3)
    unallocated_torque(torque, run(*torque, 0.5), INVERSE, out)
    assert out[0] > 0.5
    motors = run(0.05, 0.0, 0.0, 0.5)
    unallocated_torque(np.array([0.05, 0.0, 0.0]), motors, INVERSE, out)
    assert np.all(out == 0.0)
