"""The velocity of joints by an observer of their encoders' angles, and the order of samples."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.estimation import EstimatorParameters, StateEstimator
from uam_control.estimation.filters import observer_step

TICK = 0.004
COUNT = 2.0 * math.pi / 4096.0  # [rad] of an encoder
LEVEL, WEIGHT, NOTHING = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 9.81]), np.zeros(3)


def observed(angles, steps, bandwidth=20.0):
    """Return the velocities after each of `angles` [rad], `steps` [s] apart."""
    state, found = np.array([[angles[0]], [0.0]]), []
    for angle, dt in zip(angles[1:], steps, strict=True):
        observer_step(np.array([angle]), bandwidth, dt, state)
        found.append(state[1, 0])
    return np.array(found), state


def test_a_step_by_hand():
    # ln 2 = sqrt(1/2) 2 pi bandwidth dt: half is kept; to the angle 1 - 1/4, to the velocity
    # (1 + 1/4 - cos(ln 2)) / dt; predicted 1 + .1 * 2 = 1.2, seen .4 further
    state = np.array([[1.0], [2.0]])
    observer_step(np.array([1.6]), math.log(2.0) / (math.sqrt(2.0) * math.pi * 0.1), 0.1, state)
    np.testing.assert_allclose(state[0], [1.2 + 0.75 * 0.4])
    np.testing.assert_allclose(state[1], [2.0 + (1.25 - math.cos(math.log(2.0))) / 0.1 * 0.4])


@given(
    speed=st.floats(-8.0, 8.0),
    bandwidth=st.floats(2.0, 60.0),
    steps=st.lists(st.sampled_from([0.001, 0.004, 0.008, 0.02, 0.3]), min_size=20, max_size=60),
)
def test_a_ramp_leaves_no_error_whatever_samples_are_missing(speed, bandwidth, steps):
    steps = [*steps, *[TICK] * math.ceil(6.0 / (bandwidth * TICK))]
    times = np.cumsum([0.0, *steps])
    found, state = observed(1.0 + speed * times, steps, bandwidth)
    assert found[-1] == pytest.approx(speed, abs=1e-6 + 1e-6 * abs(speed))
    assert state[0, 0] == pytest.approx(1.0 + speed * times[-1], abs=1e-6)


@pytest.mark.parametrize("quantum", [0.0, COUNT])
@pytest.mark.parametrize("frequency", [0.5, 1.0, 3.0])
def test_a_sine_is_at_most_12_ms_late(frequency, quantum):
    """The lag by the phase of the first harmonic, over whole turns: sqrt(2) / (2 pi 20 Hz) less
    half a step, 9.3 ms."""
    omega, times = 2.0 * math.pi * frequency, np.arange(0.0, 6.0, TICK)
    angles = 0.5 * np.sin(omega * times)
    if quantum:
        angles = quantum * np.round(angles / quantum)
    found, _ = observed(angles, np.full(len(times) - 1, TICK))
    keep = times[1:] >= 2.0 - 1e-9
    phase = -np.angle(np.sum(found[keep] * np.exp(-1j * omega * times[1:][keep])))
    assert phase / omega == pytest.approx(0.0095, abs=0.0005)
    assert phase / omega < 0.012


@given(speed=st.floats(0.05, 5.0))
def test_what_the_counts_of_an_encoder_do_to_the_velocity_is_bounded(speed):
    """Half a count, .77 mrad, at worst at every tick with the sign of the impulse response, whose
    magnitudes add up to 121.6 1/s."""
    times = np.arange(0.0, 3.0, TICK)
    found, _ = observed(COUNT * np.round(speed * times / COUNT), np.full(len(times) - 1, TICK))
    assert np.abs(found[250:] - speed).max() < 121.7 * 0.5 * COUNT
    assert np.mean(found[250:]) == pytest.approx(speed, abs=0.02)


def test_an_angle_that_goes_round_is_followed():
    times = np.arange(0.0, 8.0, TICK)
    wrapped = (2.0 * times + math.pi) % (2.0 * math.pi) - math.pi
    found, state = observed(wrapped, np.full(len(times) - 1, TICK))
    np.testing.assert_allclose(found[250:], 2.0, rtol=1e-6)
    assert state[0, 0] == pytest.approx(2.0 * times[-1])


def turning(parameters, samples):
    """Return the state after IMU and joint samples (time, stamp of the reading or None)."""
    estimator = StateEstimator(EstimatorParameters(**parameters), 1)
    estimator.mocap(0.0, NOTHING, LEVEL)
    for time, stamp in samples:
        if stamp is not None:
            estimator.joints(stamp, np.array([0.5 * stamp]), np.array([99.0]))
        estimator.imu(time, NOTHING, WEIGHT)
    return estimator.update()


def test_the_reported_velocity_has_no_say_and_the_angle_is_that_of_the_tick():
    """Readings come 3 ms before their tick, every third is lost."""
    times = [TICK * k for k in range(250)]
    samples = [(time, None if k % 3 == 1 else time - 0.003) for k, time in enumerate(times)]
    state = turning({"joint_velocity": "observer"}, samples)
    np.testing.assert_allclose(state[1, 6], 0.5, rtol=1e-6)
    np.testing.assert_allclose(state[0, 6], 0.5 * times[-1], rtol=1e-6)
    assert turning({}, samples)[1, 6] > 1.0


@settings(max_examples=40)
@given(data=st.data(), observer=st.booleans())
def test_the_order_of_arrival_within_a_tick_does_not_matter(data, observer):
    """Poses at 360 Hz, readings at 500 Hz; late ones come with those of later ticks."""
    mode = "observer" if observer else "reported"
    drawn = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    poses = [(k / 360.0, k, drawn.normal(0.0, 1e-3, 3)) for k in range(1, 72)]
    readings = [(0.002 * k, -k, drawn.normal(0.0, 0.01, 2)) for k in range(100)]
    arrivals = [[] for _ in range(60)]
    for sample in (*poses, *readings):
        late = int(drawn.integers(0, 3)) if sample[0] > 0.02 else 0
        arrivals[min(math.ceil(sample[0] / TICK - 1e-9) + late, 59)].append(sample)

    def flown(shuffled):
        estimator, states = StateEstimator(EstimatorParameters(joint_velocity=mode), 1), []
        for k, samples in enumerate(arrivals):
            for stamp, kind, values in data.draw(st.permutations(samples)) if shuffled else samples:
                if kind > 0:
                    estimator.mocap(stamp, values, LEVEL)
                else:
                    estimator.joints(stamp, values[:1], values[1:])
            estimator.imu(TICK * k, drawn_rates[k], WEIGHT)
            if k:
                states.append(estimator.update().tobytes())
        return states

    drawn_rates = drawn.normal(0.0, 0.1, (60, 3))
    assert flown(shuffled=True) == flown(shuffled=False)


def test_a_pose_after_its_imu_sample_counts_as_one_before_from_the_next_tick_on():
    def flown(pose_first):
        estimator = StateEstimator(EstimatorParameters(), 0)
        estimator.mocap(0.0, NOTHING, LEVEL)
        for k in range(-2, 30):
            pose = TICK * k, np.array([1e-3 * k**2, 0.0, 0.0]), LEVEL
            if pose_first and k > 0:
                estimator.mocap(*pose)
            estimator.imu(TICK * k, NOTHING, WEIGHT)
            if not pose_first and k > 0:
                estimator.mocap(*pose)
        estimator.imu(TICK * 30, NOTHING, WEIGHT)
        return estimator.update().copy()

    np.testing.assert_array_equal(flown(pose_first=True), flown(pose_first=False))
