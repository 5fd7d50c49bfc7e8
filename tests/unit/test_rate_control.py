"""Filters and rate PID of the autopilot against hand-worked numbers and closed forms."""

import math

import numpy as np
import pytest

from uam_sim_bridge.autopilot.loops import rate_control as rc

DT = 0.004
NO_FILTER = rc.filter_coefficients(250.0, 0.0, 0.0, 0.0)


def gains(p=0.15, i=0.0, d=0.0, ff=0.0, limit=0.3):
    return np.array([[p] * 3, [i] * 3, [d] * 3, [ff] * 3, [limit] * 3])


def gain_of(filters, frequency):
    """Amplitude of the gyro filter for a sine, measured after the transient."""
    memory = np.zeros((7, 3))
    out = []
    for k in range(2000):
        rc.filter_gyro(np.full(3, math.sin(2 * math.pi * frequency * k * DT)), DT, filters, memory)
        out.append(memory[rc.RATES, 0])
    return max(out[1000:])


def test_butterworth_halves_the_power_at_the_cutoff():
    filters = rc.filter_coefficients(250.0, 40.0, 20.0, 2.0)
    assert gain_of(filters, 40.0) == pytest.approx(math.sqrt(0.5), abs=0.01)
    assert gain_of(filters, 1.0) == pytest.approx(1.0, abs=0.01)
    assert gain_of(filters, 100.0) < 0.1


@pytest.mark.parametrize("cutoff", [0.0, 125.0, 500.0])
def test_no_filter_outside_the_range(cutoff):
    assert rc.butterworth(250.0, cutoff) == (1.0, 0.0, 0.0, 0.0, 0.0)


def test_first_order_weight_by_hand():
    assert rc.alpha(250.0, 2.0) == pytest.approx(0.004 / (0.004 + 1 / (4 * math.pi)))
    assert rc.alpha(250.0, 0.0) == 1.0


def test_angular_acceleration_is_the_slope():
    memory = np.zeros((7, 3))
    filters = rc.filter_coefficients(250.0, 40.0, 20.0, 2.0)
    for k in range(200):
        rc.filter_gyro(np.full(3, 2.0 * k * DT), DT, filters, memory)
    assert memory[rc.ACCELERATION] == pytest.approx([2.0] * 3, rel=1e-6)


def test_reset_starts_at_rest():
    memory = np.zeros((7, 3))
    filters = rc.filter_coefficients(250.0, 40.0, 20.0, 2.0)
    value = np.array([0.3, -0.2, 0.1])
    rc.reset_filters(value, filters, memory)
    rc.filter_gyro(value, DT, filters, memory)
    assert memory[rc.RATES] == pytest.approx(value)
    assert memory[rc.ACCELERATION] == pytest.approx([0.0] * 3, abs=1e-9)


def test_pid_by_hand():
    memory = np.zeros((7, 3))
    memory[rc.RATES] = [0.2, 0.0, 0.0]
    memory[rc.ACCELERATION] = [5.0, 0.0, 0.0]
    memory[rc.INTEGRAL] = [0.05, 0.0, 0.0]
    rc.rate_torque(
        np.array([1.0, 0, 0, 0]), DT, NO_FILTER, gains(0.15, 0.2, 0.003, 0.01), False, memory
    )
    assert memory[rc.TORQUE, 0] == pytest.approx(0.15 * 0.8 + 0.05 - 0.003 * 5.0 + 0.01)
    factor = 1.0 - (0.8 / math.radians(400.0)) ** 2
    assert memory[rc.INTEGRAL, 0] == pytest.approx(0.05 + factor * 0.2 * 0.8 * DT)


def run_integral(error, landed=False, unallocated=0.0, ticks=500):
    memory = np.zeros((7, 3))
    memory[rc.UNALLOCATED] = unallocated
    for _ in range(ticks):
        rc.rate_torque(np.full(4, error), DT, NO_FILTER, gains(i=0.2), landed, memory)
    return memory[rc.INTEGRAL, 0]


def test_integral_rules():
    assert run_integral(1.0) == pytest.approx(0.3)  # at its limit
    assert run_integral(-1.0) == pytest.approx(-0.3)
    assert run_integral(1.0, landed=True) == 0.0
    assert run_integral(1.0, unallocated=0.2) == 0.0  # would saturate further
    assert run_integral(-1.0, unallocated=0.2) == pytest.approx(-0.3)  # may unwind
    assert run_integral(1.0, unallocated=-0.2) == pytest.approx(0.3)
    assert run_integral(math.radians(400.0)) == 0.0  # gain gone at 400 deg/s


def test_yaw_torque_is_slow():
    memory = np.zeros((7, 3))
    filters = rc.filter_coefficients(250.0, 0.0, 0.0, 2.0)
    ticks = round(1.0 / (2 * math.pi * 2.0) / DT)  # one time constant
    for _ in range(ticks):
        rc.rate_torque(np.ones(4), DT, filters, gains(), False, memory)
    assert memory[rc.TORQUE, 0] == pytest.approx(0.15)
    assert memory[rc.TORQUE, 2] == pytest.approx(0.15 * (1 - math.exp(-1)), rel=0.05)
