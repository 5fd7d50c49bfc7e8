"""Level hold: bounded time, thrust of the flight so far, rates against the tilt."""

import math

import numpy as np
import pytest

from uam_sim_bridge.mavlink.hold import HoldParameters, LevelHold

TILTED = np.array([0.1, -0.2, 1.0])


def flown(thrust=0.52):
    hold = LevelHold(HoldParameters())
    for k in range(1000):
        hold.good(k * 0.004, thrust)
    return hold


def test_levels_with_the_thrust_flown():
    rates, thrust = flown().setpoint(4.0, TILTED)
    assert rates == pytest.approx([-0.3, 0.6, 0.0])
    assert thrust == pytest.approx(0.52)


def test_the_last_setpoints_do_not_turn_it():
    """The autopilot keeps to them until its failsafe."""
    hold = flown()
    hold.setpoint(4.0, TILTED)
    rates, _ = hold.setpoint(5.94, TILTED)
    assert rates == pytest.approx([-0.3, 0.6, 0.0])
    rates, _ = hold.setpoint(5.96, TILTED)
    assert rates == pytest.approx([0.0, 0.0, 0.0])


def test_without_hope_it_ends_sooner():
    hold = flown()
    assert hold.setpoint(4.0, TILTED, hopeless=True) is not None
    assert hold.setpoint(4.99, TILTED, hopeless=True) is not None
    assert hold.setpoint(5.01, TILTED, hopeless=True) is None


def test_thrust_is_an_average_not_the_last_value():
    hold = flown()
    hold.good(4.0, 0.9)
    _, thrust = hold.setpoint(4.004, TILTED)
    assert 0.52 < thrust < 0.53


def test_ends_after_its_time_and_starts_anew():
    hold = flown()
    assert hold.setpoint(4.0, TILTED) is not None
    assert hold.setpoint(5.99, TILTED) is not None
    assert hold.setpoint(6.01, TILTED) is None
    hold.good(6.1, 0.5)
    assert not hold.active
    assert hold.setpoint(6.2, TILTED) is not None


def test_nothing_before_a_flight_and_after_it():
    hold = LevelHold(HoldParameters())
    assert hold.setpoint(0.0, TILTED) is None
    hold = flown()
    hold.reset()
    assert hold.setpoint(5.0, TILTED) is None


def test_strange_attitude_gives_bounded_rates():
    rates, _ = flown().setpoint(4.0, np.array([math.nan, 50.0, 0.0]))
    assert rates == pytest.approx([0.0, -2.0, 0.0])
