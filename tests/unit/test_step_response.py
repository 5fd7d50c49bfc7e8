"""Figures of step responses, on curves whose figures are known."""

import numpy as np
import pytest
from px4_steps.rate_experiment import AXES, experiment, steps
from px4_steps.step_response import distance, figures

TIME = np.arange(-10, 500) * 0.004


def first_order(constant):
    return np.where(TIME < 0.0, 0.0, 1.0 - np.exp(-TIME / constant))


def test_a_first_order_lag_has_its_time_constant_no_overshoot_and_ends_at_the_step():
    found = figures(TIME, first_order(0.1))
    assert found.time_constant == pytest.approx(0.1, rel=0.01)
    assert found.overshoot == 0.0 and found.final == pytest.approx(1.0, abs=1e-3)


def test_a_second_order_lag_overshoots_by_its_damping():
    damping, frequency = 0.5, 20.0
    damped = frequency * np.sqrt(1.0 - damping**2)
    t = np.maximum(TIME, 0.0)
    decay = np.exp(-damping * frequency * t)
    ratio = damping / np.sqrt(1.0 - damping**2)
    response = 1.0 - decay * (np.cos(damped * t) + ratio * np.sin(damped * t))
    expected = np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2))
    assert figures(TIME, response).overshoot == pytest.approx(expected, rel=0.01)


def test_a_step_that_is_never_reached_has_no_time_constant():
    assert np.isnan(figures(TIME, 0.5 * first_order(0.1)).time_constant)


def test_distance_is_a_share_of_the_step():
    assert distance(first_order(0.1), first_order(0.1) + 0.05) == pytest.approx(0.05)


def test_every_axis_is_stepped_both_ways_equally():
    planned = list(steps(experiment()))
    for axis in range(len(AXES)):
        own = [step for step in planned if step.axis == axis]
        assert sum(step.size for step in own) == 0.0 and len(own) == 2 * experiment()["repeats"]
