"""The stand-in's modes of a pilot: requests, stick override, battery failsafe."""

from __future__ import annotations

import pytest

from uam_control.offboard.modes import MavResult, Mode, Severity
from uam_control.vehicle import load_description
from uam_sim_bridge.autopilot.commander import ChargeState, Commander, SimulatedBattery
from uam_sim_bridge.autopilot.params import Parameters

CENTRED, PUSHED = (0.0, 0.0, 0.0, 0.0), (0.31, 0.0, 0.0, 0.0)  # COM_RC_STICK_OV is 30 %


def in_flight(**values):
    """A commander in OFFBOARD at 1 s."""
    parameters = Parameters.of(load_description())
    for name, value in values.items():
        parameters.set(name, value)
    commander = Commander(parameters)
    for k in range(251):
        commander.setpoint(0.004 * k)
    assert commander.request_mode(1.0, Mode.OFFBOARD, True) is MavResult.ACCEPTED
    assert commander.request_arm(1.0, []) is MavResult.ACCEPTED
    commander.take_texts()
    return commander


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.RETURN, Mode.LAND, Mode.POSITION])
def test_modes_need_an_estimate_and_position_needs_sticks(mode):
    commander = in_flight()
    free = mode is Mode.LAND
    expected = MavResult.ACCEPTED if free else MavResult.DENIED
    assert commander.request_mode(1.0, mode, aided=False) is expected
    commander = in_flight()
    if mode is Mode.POSITION:
        assert commander.request_mode(1.0, mode, aided=True) is MavResult.DENIED
        commander.sticks(1.0, CENTRED, True)
        assert commander.request_mode(1.6, mode, aided=True) is MavResult.DENIED  # 0.5 s allowed
        commander.sticks(1.6, CENTRED, True)
    assert commander.request_mode(1.6, mode, aided=True) is MavResult.ACCEPTED
    assert commander.mode is commander.intended is mode


@pytest.mark.parametrize(
    ("override", "sticks", "aided", "taken"),
    [(2, PUSHED, True, True), (1, PUSHED, True, False), (2, (0.29, 0, 0, 0), True, False),
     (2, PUSHED, False, False), (3, (0.0, 0.0, -0.5, 0.0), True, True)],
)  # fmt: skip
def test_sticks_take_over_from_offboard(override, sticks, aided, taken):
    commander = in_flight(COM_RC_OVERRIDE=override)
    commander.sticks(1.0, CENTRED, aided)
    commander.sticks(1.1, sticks, aided)
    mode = Mode.POSITION if taken else Mode.OFFBOARD
    assert commander.mode is commander.intended is mode and not commander.failsafe


def test_lost_sticks_in_position_are_a_failsafe():
    commander = in_flight()
    commander.sticks(1.0, CENTRED, True)
    commander.request_mode(1.0, Mode.POSITION, True)
    commander.update(1.5, False, ChargeState.UNDEFINED)
    assert commander.mode is Mode.POSITION
    commander.update(1.51, False, ChargeState.UNDEFINED)
    assert commander.mode is Mode.LAND and commander.failsafe
    assert commander.intended is Mode.POSITION


@pytest.mark.parametrize(
    ("action", "battery", "mode"),
    [(0, ChargeState.EMERGENCY, Mode.OFFBOARD), (2, ChargeState.LOW, Mode.OFFBOARD),
     (2, ChargeState.CRITICAL, Mode.LAND), (3, ChargeState.CRITICAL, Mode.RETURN),
     (3, ChargeState.EMERGENCY, Mode.LAND)],
)  # fmt: skip
def test_the_battery_failsafe_keeps_the_intended_mode(action, battery, mode):
    commander = in_flight(COM_LOW_BAT_ACT=action)
    commander.update(1.004, False, battery)
    assert commander.mode is mode and commander.intended is Mode.OFFBOARD
    assert commander.failsafe is (mode is not Mode.OFFBOARD)


def test_a_person_may_leave_the_battery_failsafe_once():
    commander = in_flight(COM_LOW_BAT_ACT=2)
    commander.update(1.004, False, ChargeState.CRITICAL)
    assert commander.request_mode(1.1, Mode.HOLD, True) is MavResult.ACCEPTED
    commander.update(1.2, False, ChargeState.CRITICAL)
    assert commander.mode is Mode.HOLD and not commander.failsafe


def test_the_battery_falls_linearly_while_armed_down_to_its_minimum():
    parameters = Parameters.of(load_description())
    battery = SimulatedBattery(parameters)
    battery.update(0.0, True)
    assert battery.charge is None
    for name, value in {"SIM_BAT_ENABLE": 1, "SIM_BAT_DRAIN": 60, "SIM_BAT_MIN_PCT": 50}.items():
        parameters.set(name, value)
    battery.update(10.0, False)
    assert battery.charge == 1.0
    for time, charge in ((10.0, 1.0), (25.0, 0.75), (100.0, 0.5)):
        battery.update(time, True)
        assert battery.charge == pytest.approx(charge)


@pytest.mark.parametrize(
    ("time", "state"),
    [(0.0, "OK"), (84.9, "OK"), (85.1, "LOW"), (92.9, "LOW"), (93.1, "CRITICAL"),
     (94.9, "CRITICAL"), (95.1, "EMERGENCY"), (200.0, "EMERGENCY")],
)  # fmt: skip
def test_the_charge_state_follows_the_three_thresholds(time, state):
    """Full to empty in 100 s; PX4's defaults 0.15, 0.07 and 0.05."""
    parameters = Parameters.of(load_description())
    battery = SimulatedBattery(parameters)
    assert battery.state is ChargeState.UNDEFINED
    for name, value in {"SIM_BAT_ENABLE": 1, "SIM_BAT_DRAIN": 100, "SIM_BAT_MIN_PCT": 1}.items():
        parameters.set(name, value)
    battery.update(0.0, True)
    battery.update(time, True)
    assert battery.state.name == state


def test_each_worse_charge_state_warns_once_in_a_flight():
    commander = in_flight(COM_LOW_BAT_ACT=0)
    commander.take_texts()
    for state in (ChargeState.OK, ChargeState.LOW, ChargeState.LOW, ChargeState.OK,
                  ChargeState.LOW, ChargeState.CRITICAL, ChargeState.EMERGENCY):  # fmt: skip
        commander.update(1.004, False, state)
    assert commander.take_texts() == [
        (Severity.EMERGENCY, "Low battery"),
        (Severity.EMERGENCY, "Critical battery"),
        (Severity.EMERGENCY, "Emergency battery level"),
    ]
    assert commander.mode is Mode.OFFBOARD and not commander.failsafe
    commander.request_disarm(landed=True, force=False)
    commander.take_texts()
    commander.update(1.1, True, ChargeState.LOW)
    assert commander.take_texts() == [], "no warnings while disarmed"
