"""The measured delay of the attitude loop: a known delay, a quiet vehicle, gaps, wrong models."""

import math

import numpy as np
import pytest

from uam_control.supervision import Readings, SupervisionParameters
from uam_control.supervision.setpoint_delay import margin_left, setpoint_delay
from uam_sim_bridge.mavlink.offboard.loop_delay import DELAYS, LoopDelay

PERIOD, LAG = 0.004, 0.017


class Loop:
    """omega_dot = 20 lag(omega_sp(t - T) - omega), with gyro noise; omega_sp: noise and a sine."""

    def __init__(self, ticks, excitation=0.3, noise=0.003, seed=1):
        self.random = np.random.default_rng(seed)
        self.ticks, self.excitation, self.noise = ticks, excitation, noise
        self.sent = [np.zeros(3)] * (ticks + 1)
        self.rates, self.slope, self.slow = np.zeros(3), np.zeros(3), np.zeros(3)
        self.tick = 0

    def step(self):
        """Return the setpoint that is sent and the measured rates of the next tick."""
        self.tick += 1
        self.slow += 0.05 * (self.excitation * self.random.standard_normal(3) * 4.0 - self.slow)
        setpoint = self.slow.copy()
        self.sent = [*self.sent[1:], setpoint]
        measured = self.rates + self.noise * self.random.standard_normal(3)
        keep = math.exp(-PERIOD / LAG)
        self.slope = keep * self.slope + (1.0 - keep) * 20.0 * (self.sent[0] - self.rates)
        self.rates = self.rates + PERIOD * self.slope
        return setpoint, measured


def measured(loop, seconds, meter=None, begin=0.0):
    meter = meter or LoopDelay(LAG, PERIOD)
    for k in range(round(seconds / PERIOD)):
        meter.update(begin + k * PERIOD, *loop.step())
    return meter


@pytest.mark.parametrize("ticks", [0, 1, 4, 8, 20])
def test_a_known_delay(ticks):
    meter = measured(Loop(ticks), 4.0)
    # the rate of the next tick is the first that a setpoint changes
    assert meter.value == pytest.approx((ticks + 1) * PERIOD, abs=0.0015)
    assert meter.explained > 0.9


def test_a_vehicle_that_does_not_move_gives_no_value():
    meter = measured(Loop(4, excitation=0.0, noise=0.0001), 4.0)
    assert math.isnan(meter.value)
    noisy = measured(Loop(4, excitation=0.0, noise=0.02), 4.0)
    assert math.isnan(noisy.value) and noisy.explained < 0.5


def test_the_first_value_takes_a_second():
    meter, loop = LoopDelay(LAG, PERIOD), Loop(2)
    assert math.isnan(measured(loop, 0.9, meter).value)
    assert math.isfinite(measured(loop, 0.4, meter, begin=0.9).value)


def test_a_change_is_followed():
    meter, loop = LoopDelay(LAG, PERIOD), Loop(2)
    measured(loop, 5.0, meter)
    loop.sent = [loop.sent[0]] * 8 + loop.sent  # 8 ticks more
    measured(loop, 6.0, meter, begin=5.0)
    assert meter.value == pytest.approx(11 * PERIOD, abs=0.003)


def test_a_pause_and_a_gap_lose_the_value_and_not_the_next_one():
    meter, loop = LoopDelay(LAG, PERIOD), Loop(3)
    measured(loop, 3.0, meter)
    before = meter.value
    meter.pause()
    assert math.isnan(meter.value)
    measured(loop, 1.0, meter, begin=30.0)
    assert meter.value == pytest.approx(before, abs=0.002)
    meter.update(99.0, *loop.step())
    measured(loop, 1.0, meter, begin=99.004)
    assert meter.value == pytest.approx(before, abs=0.002)


def test_a_delay_beyond_the_longest_is_the_longest():
    assert measured(Loop(DELAYS + 3), 4.0).value >= 0.8 * (DELAYS - 1) * PERIOD or math.isnan(
        measured(Loop(DELAYS + 3), 4.0).value
    )


def test_a_body_that_turns_the_other_way_gives_no_value():
    meter, loop = LoopDelay(LAG, PERIOD), Loop(3)
    for k in range(1000):
        setpoint, rates = loop.step()
        meter.update(k * PERIOD, -4.0 * setpoint, rates)
    assert math.isnan(meter.value)


LIMITS = SupervisionParameters(
    delay_margin=0.05, delay_nominal=0.006, joint_angle_hold=(1.0,), joint_effort_hold=(1.0,)
)


def test_delay_of_the_setpoints():
    both = Readings(round_trip=0.02, loop_delay=0.026)
    assert setpoint_delay(both, LIMITS, True) == pytest.approx(0.02)  # measured, less the nominal
    assert setpoint_delay(both, LIMITS, False) == pytest.approx(0.02)  # the whole round trip
    late = Readings(round_trip=0.1, loop_delay=0.026)
    assert setpoint_delay(late, LIMITS, True) == pytest.approx(0.05)  # half of the round trip
    assert setpoint_delay(Readings(round_trip=0.03), LIMITS, True) == pytest.approx(0.015)
    assert setpoint_delay(Readings(loop_delay=0.03), LIMITS, True) == pytest.approx(0.024)
    assert math.isnan(setpoint_delay(Readings(), LIMITS, True))
    assert setpoint_delay(Readings(loop_delay=0.001), LIMITS, True) == 0.0
    assert margin_left(0.02, LIMITS) == pytest.approx(0.6)
