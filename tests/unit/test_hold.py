"""Level hold: bounded time, mean thrust of the flight, body rates against the tilt."""

import math

import numpy as np
import pytest

from uam_control.setpoints.level_hold import UNKNOWN, HoldParameters, LevelHold
from uam_control.setpoints.targets import Desired, level

TILTED = np.array([0.1, -0.2, 1.0])
LEVEL = np.zeros(3)


def flown(thrust=0.52):
    hold = LevelHold(HoldParameters(), 9.81)
    for k in range(1000):
        hold.good(k * 0.004, Desired(np.zeros(3), level(0.0), thrust), LEVEL)
    return hold


def test_levels_with_the_thrust_flown():
    desired = flown().setpoint(4.0, TILTED, UNKNOWN)
    assert desired.rates == pytest.approx([-0.6, 1.2, 0.0], rel=0.05)
    assert desired.thrust == pytest.approx(0.52)


def test_a_tilt_that_stays_is_met_by_more_and_more():
    """The autopilot's rate loop alone does not compensate the arm's torque."""
    hold, rates = flown(), []
    for k in range(250):
        rates.append(hold.setpoint(4.0 + 0.004 * k, np.array([0.0, -0.1, 0.0]), UNKNOWN).rates[1])
    assert np.all(np.diff(rates) > 0.0) and rates[-1] == pytest.approx(0.6 + 0.6, rel=0.02)


@pytest.mark.parametrize(
    ("velocity", "yaw", "signs"),
    [
        ((0.5, 0.0, 0.0), 0.0, (0, -1)),  # forward: nose up
        ((0.0, 0.5, 0.0), 0.0, (1, 0)),  # to the left: left side up
        ((0.5, 0.0, 0.0), math.pi / 2, (-1, 0)),
        ((0.0, 0.5, 0.0), math.pi / 2, (0, -1)),
    ],
)
def test_tilts_against_the_velocity(velocity, yaw, signs):
    rates = flown().setpoint(4.0, np.array([0.0, 0.0, yaw]), np.array(velocity)).rates
    assert rates[:2] == pytest.approx(np.array(signs) * 6.0 * 0.5 / 9.81, rel=0.03, abs=1e-9)


def test_thrust_acts_against_sinking_within_a_limit():
    thrust = flown().setpoint(4.0, LEVEL, np.array([0.0, 0.0, -0.5])).thrust
    assert thrust == pytest.approx(0.52 * (1.0 + 0.5 / 9.81))
    thrust = flown().setpoint(4.0, LEVEL, np.array([0.0, 0.0, 99.0])).thrust
    assert thrust == pytest.approx(0.52 * (1.0 - 1.5 / 9.81))


def test_the_last_setpoints_do_not_turn_it():
    """The autopilot uses them until its failsafe."""
    hold = flown()
    hold.setpoint(4.0, TILTED, UNKNOWN)
    rates = hold.setpoint(5.94, TILTED, UNKNOWN).rates
    assert np.all(rates[:2] != 0.0)
    rates = hold.setpoint(5.96, TILTED, UNKNOWN).rates
    assert rates == pytest.approx([0.0, 0.0, 0.0])


def test_without_hope_it_ends_sooner():
    hold = flown()
    assert hold.setpoint(4.0, TILTED, UNKNOWN, 1.0) is not None
    assert hold.setpoint(4.99, TILTED, UNKNOWN, 1.0) is not None
    assert hold.setpoint(5.01, TILTED, UNKNOWN, 1.0) is None


def test_thrust_is_an_average_not_the_last_value():
    hold = flown()
    hold.good(4.0, Desired(np.zeros(3), level(0.0), 0.9), LEVEL)
    thrust = hold.setpoint(4.004, TILTED, UNKNOWN).thrust
    assert 0.52 < thrust < 0.53


def test_the_thrust_of_a_command_that_is_not_flown_does_not_count():
    hold = flown()
    before = hold.mean_thrust
    for k in range(100):
        hold.good(4.0 + 0.004 * k, Desired(np.zeros(3), level(0.0), 0.9), LEVEL, followed=False)
    assert hold.mean_thrust == before and not hold.active


def test_ends_after_its_time_and_starts_anew():
    hold = flown()
    assert hold.setpoint(4.0, TILTED, UNKNOWN) is not None
    assert hold.setpoint(5.99, TILTED, UNKNOWN) is not None
    assert hold.setpoint(6.01, TILTED, UNKNOWN) is None
    hold.good(6.1, Desired(np.zeros(3), level(0.0), 0.5), LEVEL)
    assert not hold.active
    assert hold.setpoint(6.2, TILTED, UNKNOWN) is not None


def test_nothing_before_a_flight_and_after_it():
    hold = LevelHold(HoldParameters(), 9.81)
    assert hold.setpoint(0.0, TILTED, UNKNOWN) is None
    hold = flown()
    hold.reset()
    assert hold.setpoint(5.0, TILTED, UNKNOWN) is None


def test_strange_attitude_gives_bounded_rates():
    rates = flown().setpoint(4.0, np.array([math.nan, 50.0, math.nan]), np.ones(3)).rates
    assert rates == pytest.approx([0.0, -2.0, 0.0])


def test_less_gravity_means_more_tilt():
    # the desired tilt of 0.5 m/s^2 is 0.5 / g, and the rate is 6 times the tilt
    moon, earth = LevelHold(HoldParameters(), 1.625), LevelHold(HoldParameters(), 9.75)
    for hold in (moon, earth):
        hold.good(0.0, Desired(np.zeros(3), level(0.0), 0.5), LEVEL)
    found = [
        hold.setpoint(0.0, LEVEL, np.array([-0.1, 0.0, 0.0])).rates[1].item()
        for hold in (moon, earth)
    ]
    assert found == pytest.approx([6.0 * 0.1 / 1.625, 6.0 * 0.1 / 9.75])


def test_the_thrust_of_a_tilted_flight_counts_by_its_vertical_part():
    hold, attitude = LevelHold(HoldParameters(), 9.81), np.array([0.6, -0.3, 1.0])
    hold.good(0.0, Desired(np.zeros(3), level(0.0), 0.5), attitude)
    assert hold.mean_thrust == pytest.approx(0.5 * math.cos(0.6) * math.cos(0.3))


def test_a_fast_vehicle_is_braked_before_it_is_left_to_the_autopilot():
    """Its descent is level: at 5 m/s across the vehicle would turn over on the ground."""
    hold, time, speed = flown(), 4.0, 5.0
    while (
        desired := hold.setpoint(time, LEVEL, np.array([speed, 0.0, 0.0]), 0.4, True)
    ) is not None:
        braked, time, speed = time, time + 0.02, speed - 0.02 * 9.81 * -desired.attitude[0, 1]
    assert speed == pytest.approx(1.0, abs=0.1) and braked == pytest.approx(
        4.0 + 3.5 / 1.5 + math.log(1.5) + 0.4, abs=0.1
    )


@pytest.mark.parametrize(("speed", "longest"), [(0.9, 0.4), (math.nan, 0.4), (50.0, 4.4)])
def test_a_slow_or_unknown_one_is_not_and_no_braking_is_endless(speed, longest):
    hold, velocity = flown(), np.array([speed, 0.0, 0.0])
    hold.setpoint(4.0, LEVEL, velocity, 0.4, True)
    for k in range(1000):
        if hold.setpoint(4.0 + 0.01 * k, LEVEL, velocity, 0.4, True) is None:
            break
    assert 0.01 * k == pytest.approx(longest, abs=0.02)
