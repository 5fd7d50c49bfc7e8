"""The measured delay of the attitude loop: a known delay, a quiet vehicle, gaps, wrong models."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from uam_control.setpoints.loop_delay import LoopDelay, follow, pause
from uam_control.supervision import SupervisionParameters
from uam_control.supervision.checks import by_link, by_loop, larger, margin_left
from uam_control.vehicle import derived_parameters, load_description

PERIOD, LAG = 0.004, 0.017


def nothing(time, rates):
    return np.zeros(3)


class Loop:
    """omega_dot = gain lag(omega_sp(t - T) - omega) + disturbance(t, omega), with gyro noise.

    omega_sp: low-passed noise, and `feedback` times the measured rates, as a law has it.
    """

    def __init__(
        self, ticks, excitation=0.3, noise=0.003, seed=1, gain=20.0, feedback=0.0,
        disturbance=nothing,
    ):  # fmt: skip
        self.random = np.random.default_rng(seed)
        self.ticks, self.excitation, self.noise = ticks, excitation, noise
        self.gain, self.feedback, self.disturbance = gain, feedback, disturbance
        self.sent = [np.zeros(3)] * (ticks + 1)
        self.rates, self.slope, self.slow = np.zeros(3), np.zeros(3), np.zeros(3)
        self.tick = 0

    def step(self):
        """Return the setpoint that is sent and the measured rates of the next tick."""
        self.tick += 1
        self.slow += 0.05 * (self.excitation * self.random.standard_normal(3) * 4.0 - self.slow)
        measured = self.rates + self.noise * self.random.standard_normal(3)
        setpoint = self.slow + self.feedback * measured
        self.sent = [*self.sent[1:], setpoint]
        keep = math.exp(-PERIOD / LAG)
        self.slope = keep * self.slope + (1.0 - keep) * self.gain * (self.sent[0] - self.rates)
        other = self.disturbance(self.tick * PERIOD, self.rates)
        self.rates = self.rates + PERIOD * (self.slope + other)
        return setpoint, measured


def take(meter, stamp, setpoint, rates):
    """Take a tick; return the value."""
    follow(stamp, setpoint, rates, meter.sums, meter.numbers)
    return meter.value


def measured(loop, seconds, meter=None, begin=0.0):
    meter = meter or LoopDelay(LAG, PERIOD)
    for k in range(round(seconds / PERIOD)):
        take(meter, begin + k * PERIOD, *loop.step())
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
    pause(meter.sums)
    assert math.isnan(meter.value)
    measured(loop, 1.0, meter, begin=30.0)
    assert meter.value == pytest.approx(before, abs=0.002)
    take(meter, 99.0, *loop.step())
    measured(loop, 1.0, meter, begin=99.004)
    assert meter.value == pytest.approx(before, abs=0.002)


def test_a_delay_beyond_the_longest_is_the_longest():
    value = measured(Loop(34), 4.0).value  # 30 periods are 120 ms
    assert value >= 0.8 * 0.12 or math.isnan(value)


def test_a_delay_of_many_short_ticks(monkeypatch):
    """45 ticks of 2 ms; 30 ticks are 60 ms, less than what the loops stand."""
    monkeypatch.setattr(sys.modules[__name__], "PERIOD", 0.002)
    assert measured(Loop(44), 4.0).value == pytest.approx(0.090, abs=0.003)


def test_a_body_that_turns_the_other_way_gives_no_value():
    meter, loop = LoopDelay(LAG, PERIOD), Loop(3)
    for k in range(1000):
        setpoint, rates = loop.step()
        take(meter, k * PERIOD, -4.0 * setpoint, rates)
    assert math.isnan(meter.value)


def values(loop, seconds):
    """Every value [s] of a flight, and those of its last two thirds."""
    meter = LoopDelay(LAG, PERIOD)
    found = [take(meter, k * PERIOD, *loop.step()) for k in range(round(seconds / PERIOD))]
    return np.array(found), np.array(found[len(found) // 3 :])


def trembling_arm(time, rates):
    """As recorded on the plant of a laboratory: 12.5 Hz about the pitch axis, 0.5 rad/s RMS."""
    return np.array([0.0, 55.0 * math.sin(2.0 * math.pi * 12.5 * time), 0.0])


def contact(time, rates):
    """The arm on a stand from 3 s to 6 s: blows at 5 Hz, friction about both axes."""
    if not 3.0 <= time < 6.0:
        return np.zeros(3)
    blow = 8.0 if (time * 5.0) % 1.0 < 0.1 else 0.0
    return np.array([-4.0 * rates[0], blow - 15.0 * rates[1], 0.0])


def propellers(time, rates):
    return 40.0 * np.sin(2.0 * math.pi * np.array([78.0, 91.0, 78.0]) * time)


def swinging_payload(time, rates):
    return np.array([0.4, 1.2, 0.0]) * math.sin(2.0 * math.pi * 1.3 * time)


DISTURBED = {
    "the arm trembles": {"disturbance": trembling_arm, "feedback": 0.8},
    "contact": {"disturbance": contact},
    "propellers": {"disturbance": propellers, "noise": 0.03},
    "a payload swings": {"disturbance": swinging_payload, "feedback": 0.3},
    "heavy": {"gain": 12.0},
    "light": {"gain": 34.0},
}


@pytest.mark.parametrize("what", DISTURBED)
@pytest.mark.parametrize("late", [0.0, 0.010, 0.020, 0.030, 0.050])
def test_whatever_shakes_the_vehicle_the_value_is_right_or_unknown(what, late):
    ticks = math.ceil(late / PERIOD)
    found, _ = values(Loop(ticks, **DISTURBED[what]), 9.0)
    known = found[np.isfinite(found)]
    assert len(known) > 0.5 * len(found)
    np.testing.assert_allclose(known, (ticks + 1) * PERIOD, atol=0.006)


def test_without_a_setpoint_that_moves_the_vehicle_nothing_else_gives_a_value():
    for what in ("the arm trembles", "propellers"):
        found, _ = values(Loop(3, excitation=0.0, **DISTURBED[what]), 6.0)
        assert np.isnan(found).all(), what


def test_axes_that_contradict_each_other_give_no_value():
    late, early = Loop(12, seed=3), Loop(3, seed=4)
    meter = LoopDelay(LAG, PERIOD)
    for k in range(1000):
        (one, roll), (other, pitch) = late.step(), early.step()
        take(
            meter, k * PERIOD, np.array([one[0], other[1], 0.0]), np.array([roll[0], pitch[1], 0.0])
        )
    assert math.isnan(meter.value) and meter.explained > 0.9


@pytest.mark.parametrize("gain", [2.0, 120.0])
def test_a_gain_that_no_rate_loop_has_gives_no_value(gain):
    # a body that answers at once or hardly: the fit is good, but not one of a rate loop
    meter, loop = LoopDelay(LAG, PERIOD), Loop(3, gain=gain)
    for k in range(1500):
        take(meter, k * PERIOD, *loop.step())
    assert math.isnan(meter.value)


NOMINAL = 0.006
LIMITS = SupervisionParameters(
    delay_margin=0.05, delay_nominal=NOMINAL, joint_angle_hold=(1.0,), joint_effort_hold=(1.0,)
)


def test_delay_of_the_setpoints():
    assert by_loop(0.026, NOMINAL, True) == pytest.approx(0.02)  # measured, less the nominal
    assert by_link(0.02, 1.0, True) == pytest.approx(0.01)  # half of the round trip
    assert by_link(0.02, 1.0, False) == pytest.approx(0.02)  # the whole round trip
    assert by_loop(0.001, NOMINAL, True) == 0.0
    assert math.isnan(by_loop(0.026, NOMINAL, False))  # it counts in flight
    assert math.isnan(by_loop(math.nan, NOMINAL, True)) and math.isnan(by_link(math.nan, 1.0, True))
    assert margin_left(0.02, LIMITS) == pytest.approx(0.6)


def test_the_larger_delay_counts_and_an_unknown_one_does_not():
    assert larger(0.01, 0.02) == larger(0.02, 0.01) == 0.02
    assert larger(0.01, math.nan) == larger(math.nan, 0.01) == 0.01
    assert math.isnan(larger(math.nan, math.nan))


@pytest.mark.parametrize(("period", "nominal"), [(0.002, 0.0), (0.004, 0.007), (0.008, 0.0214)])
def test_a_link_without_delay_has_the_loop_delay_of_its_tick(period, nominal):
    """Measured in flights of the S-500: 0.0, 5.9 and 21.3 ms; the rest counts as the link's."""
    vehicle = replace(load_description(), control_period=period)
    found = derived_parameters(vehicle)
    assert found["mission"]["delay_nominal"] == pytest.approx(nominal)
    assert found["attitude_controller"]["prediction_nominal"] == pytest.approx(nominal)
