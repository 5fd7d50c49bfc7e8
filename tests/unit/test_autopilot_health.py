"""Decoding of battery, estimator flags and sensor health; unknown values are NaN."""

import math

import numpy as np
import pytest

from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.telemetry import battery_status, estimator_status, sys_status
from uam_sim_bridge.mavlink.protocol.wire import mavlink2
from uam_sim_bridge.mavlink.telemetry.vitals import (
    ESTIMATOR_FLAGS,
    SENSORS,
    Vitals,
    estimate_faults,
    from_battery_status,
    from_sys_status,
    names,
    unhealthy,
)

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def status(voltages, extra=(), current=1234, left=57, consumed=800, temperature=2500):
    cells = [*voltages, *[0xFFFF] * (10 - len(voltages))]
    return mavlink2.MAVLink_battery_status_message(
        0,
        0,
        1,
        temperature,
        cells,
        current,
        consumed,
        -1,
        left,
        voltages_ext=[*extra, *[0] * (4 - len(extra))],
    )


def test_cells():
    battery = from_battery_status(status([4100, 4090, 4080, 4110]))
    assert battery.voltage == pytest.approx(16.38)
    assert battery.cells == pytest.approx((4.10, 4.09, 4.08, 4.11))
    assert (battery.current, battery.left) == pytest.approx((12.34, 0.57))
    assert (battery.consumed, battery.temperature) == pytest.approx((0.8, 25.0))


def test_only_the_sum():
    assert from_battery_status(status([16380])).voltage == pytest.approx(16.38)
    assert from_battery_status(status([16380])).cells == ()
    assert from_battery_status(status([65534, 34466])).voltage == pytest.approx(100.0)
    assert from_battery_status(status([4000] * 10, [4000, 4000])).voltage == pytest.approx(48.0)


def test_unknown_is_nan():
    battery = from_battery_status(status([], current=-1, left=-1, consumed=-1, temperature=32767))
    assert not battery.known
    assert all(
        map(
            math.isnan,
            (battery.voltage, battery.current, battery.left, battery.consumed, battery.temperature),
        )
    )


def test_battery_from_sys_status():
    m = mavlink2.MAVLink_sys_status_message(0, 0, 0, 0, 15000, 250, 80, 0, 0, 0, 0, 0, 0)
    battery = from_sys_status(m)
    assert (battery.voltage, battery.current, battery.left) == pytest.approx((15.0, 2.5, 0.8))
    m.voltage_battery = 0xFFFF
    assert not from_sys_status(m).known


def test_the_stand_in_has_no_battery():
    autopilot = Autopilot()
    assert not from_battery_status(battery_status(autopilot, 0.0)).known
    assert not from_sys_status(sys_status(autopilot, 0.0)).known


def test_a_charge_without_a_voltage_is_kept():
    vitals, autopilot = Vitals(), Autopilot()
    autopilot.set_parameter("SIM_BAT_ENABLE", 1)
    autopilot.battery.update(0.0, False)
    vitals.take("BATTERY_STATUS", battery_status(autopilot, 0.0))
    vitals.take("SYS_STATUS", sys_status(autopilot, 0.0))
    assert vitals.battery.left == 1.0


def test_the_stand_in_reports_its_simulated_battery():
    autopilot = Autopilot()
    for name, value in {"SIM_BAT_ENABLE": 1, "SIM_BAT_DRAIN": 100, "SIM_BAT_MIN_PCT": 1}.items():
        autopilot.set_parameter(name, value)
    autopilot.battery.update(0.0, armed=True)
    autopilot.battery.update(88.0, armed=True)
    m = battery_status(autopilot, 88.0)
    assert m.charge_state == mavlink2.MAV_BATTERY_CHARGE_STATE_LOW
    assert m.battery_remaining == 12 and from_battery_status(m).left == pytest.approx(0.12)


def test_the_stand_ins_estimate_needs_vision():
    autopilot = Autopilot()
    assert estimate_faults(estimator_status(autopilot, 0.0).flags) == (
        "no horizontal position estimate",
        "no height estimate",
    )
    autopilot.vision(0.0, np.zeros(3), LEVEL)
    m = estimator_status(autopilot, 0.1)
    assert estimate_faults(m.flags) == () and m.time_usec == 100_000


def test_flags_have_names():
    assert names(1 | 8 | 128, ESTIMATOR_FLAGS) == ("attitude", "pos_horiz_rel", "const_pos_mode")
    assert estimate_faults(0) == (
        "no valid attitude estimate",
        "no horizontal position estimate",
        "no height estimate",
    )
    assert "accelerometer data are bad" in estimate_faults(0xFFFF)
    assert SENSORS[1] == "3d_gyro" and SENSORS[128] == "vision_position"
    assert unhealthy(1 | 2 | 128, 1 | 2 | 128, 1 | 2) == ("vision_position",)
    assert unhealthy(1, 1 | 2, 0) == ("3d_gyro",)


def test_the_radio_is_received_where_it_is_there_and_healthy():
    radio, gyro = mavlink2.MAV_SYS_STATUS_SENSOR_RC_RECEIVER, 1
    vitals = Vitals()
    assert vitals.radio is None
    for there, healthy, received in ((gyro, gyro, False), (gyro | radio, gyro, False),
                                     (gyro | radio, gyro | radio, True)):  # fmt: skip
        message = mavlink2.MAVLink_sys_status_message(
            there, there, healthy, 0, 65535, -1, -1, 0, 0, 0, 0, 0, 0
        )
        vitals.take("SYS_STATUS", message)
        assert vitals.radio is received
