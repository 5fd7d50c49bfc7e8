"""The arm's driver at protocol level: commands, limits, errors, lost servos, wrong wiring."""

import dataclasses
import math
import time
from contextlib import closing

import numpy as np
import pytest
from arm_rig import BAUD, PATIENT, STOWED, ArmRig, described
from hypothesis import given, settings
from hypothesis import strategies as st
from servo_shafts import StillShaft

from uam_sim_bridge.devices.dynamixel.bus import BusLost
from uam_sim_bridge.devices.dynamixel.chain import ArmError
from uam_sim_bridge.devices.dynamixel.driver import ArmDriver, goal_current, goal_position
from uam_sim_bridge.devices.dynamixel.emulated import EmulatedBus, EmulatedServo
from uam_sim_bridge.devices.dynamixel.parameters import ArmDriverParameters

UNIT = 0.00269 * 1.304  # [N m] of one count of current


def test_the_arm_is_read_and_driven():
    rig = ArmRig().start()
    reading = rig.cycle(2, effort=[0.5, -0.3])
    assert reading.position == pytest.approx(STOWED, abs=2e-3)
    assert reading.effort == pytest.approx([0.5, -0.3], abs=UNIT / 2 + 1e-9)
    assert rig.currents == pytest.approx([0.5 / 1.304, -0.3 / 1.304], abs=0.00135)
    assert rig.driver.problems == []


def test_before_the_first_command_the_torque_is_zero():
    rig = ArmRig().start()
    rig.cycle(3)
    assert rig.currents == [0.0, 0.0] and rig.driver.stale


def test_a_reversed_servo_is_read_and_driven_reversed():
    rig = ArmRig([StillShaft(0.2), StillShaft(-math.pi / 2, velocity=1.0)], chain={"direction": -1})
    rig.start()
    reading = rig.cycle(2, effort=[0.5, -0.3])
    assert reading.position == pytest.approx([-0.2, math.pi / 2], abs=2e-3)
    assert reading.velocity[1] == pytest.approx(-1.0, abs=0.02)
    assert rig.currents[0] < 0.0 < rig.currents[1]
    assert reading.effort == pytest.approx([0.5, -0.3], abs=UNIT / 2 + 1e-9)


def test_settings_are_written_and_remarked():
    rig = ArmRig()
    rig.driver.start()
    text = "\n".join(rig.driver.remarks)
    assert "alpha_1 (id 1): Operating Mode was 3 (position), is now 0 (current)" in text
    assert "alpha_2 (id 2): Return Delay Time was 250, is now 0" in text
    assert "alpha_2 (id 2): Current Limit was 1193, is now 855" in text
    again = ArmRig(servos=rig.servos, shafts=rig.shafts)
    again.driver.start()
    assert again.driver.remarks == []


def test_wrong_settings_are_refused_where_they_may_not_be_written():
    with pytest.raises(ArmError) as refused:
        ArmRig(write_settings=False).driver.start()
    text = str(refused.value)
    assert "alpha_1 (id 1): Operating Mode is 3 (position), 0 (current) is needed" in text
    assert "alpha_2 (id 2): Return Delay Time is 250, 0 is needed" in text and "\n" not in text


def test_a_reversed_drive_mode_is_refused():
    rig = ArmRig()
    rig.servos[1].set("Drive Mode", 1)
    with pytest.raises(ArmError, match=r"alpha_2 \(id 2\): Drive Mode 1 \(reverse direction\)"):
        rig.driver.start()


def refusal(change):
    rig = ArmRig()
    change(rig.servos)
    with pytest.raises(ArmError) as refused:
        rig.driver.start()
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_a_wrong_id_is_named_with_the_ids_on_the_bus():
    text = refusal(lambda servos: servos[1].set("ID", 7))
    assert "alpha_2 (id 2): no answer at 1000000 baud" in text
    assert "ids on the bus: 1 (xm430_w210), 7 (xm430_w210)" in text


def test_a_missing_servo_is_named():
    def unplug(servos):
        servos[1].connected = False

    assert "alpha_2 (id 2): no answer" in refusal(unplug)


def test_another_baud_rate_is_found():
    def slow(servos):
        for servo in servos:
            servo.set("Baud Rate", 1)

    text = refusal(slow)
    assert "id 1 answers at 57600 baud, id 2 answers at 57600 baud" in text


def test_two_servos_of_one_id_are_suspected():
    def same(servos):
        servos[1].set("ID", 1)
        servos[1].set("Firmware Version", 45)

    text = refusal(same)
    assert "alpha_1 (id 1): damaged answers: two servos with this id" in text
    assert "alpha_2 (id 2): no answer" in text


def test_another_model_is_named():
    text = refusal(lambda servos: servos[0].set("Model Number", 1120))
    assert "alpha_1 (id 1): is a xm540_w270, xm430_w210 is described" in text


def test_swapped_servos_of_two_models_are_seen():
    rig = ArmRig()
    other = EmulatedServo(1, StillShaft(), model="xm430_w350", baud_rate=BAUD)
    chain = described()
    servos = (chain.servos[0], dataclasses.replace(chain.servos[1], table=other.table))
    rig = ArmRig(servos=[other, EmulatedServo(2, StillShaft(), baud_rate=BAUD)])
    rig.driver.chain = dataclasses.replace(chain, servos=servos)
    with pytest.raises(ArmError, match="the models fit if alpha_1 and alpha_2 are swapped"):
        rig.driver.start()


POSES = [
    ((math.pi / 2, 0.0), "ids 1 and 2 are swapped"),
    ((0.0, -math.pi / 2), "the direction of alpha_2 is reversed"),
    ((-math.pi / 2, 0.0), "ids 1 and 2 are swapped and the direction of alpha_2 is reversed"),
]


@pytest.mark.parametrize("pose, reason", POSES)
def test_a_pose_that_a_wrong_wiring_explains_is_remarked(pose, reason):
    rig = ArmRig([StillShaft(angle) for angle in pose])
    rig.driver.start()
    (line,) = [one for one in rig.driver.remarks if "not stowed" in one]
    assert line.endswith(f"the angles fit if {reason}")


def test_a_pose_outside_the_range_is_remarked():
    rig = ArmRig([StillShaft(math.radians(130)), StillShaft(STOWED[1])])
    rig.driver.start()
    assert any("130 deg is outside its range -110 to 110" in one for one in rig.driver.remarks)


def test_a_stale_command_means_zero_torque():
    rig = ArmRig(effort_timeout=0.1).start()
    rig.cycle(2, effort=[0.5, 0.5])
    rig.cycle(20)  # up to 80 ms old
    assert rig.currents[0] > 0.0
    rig.cycle(10)
    assert rig.currents == [0.0, 0.0] and rig.driver.stale


def test_the_watchdog_of_a_silent_host():
    rig = ArmRig(watchdog=0.1).start()
    rig.cycle(3, effort=[0.5, 0.5])
    rig.clock.now += 0.2  # the host stands still
    rig.line.tick()
    assert rig.currents == [0.0, 0.0]
    rig.cycle(4, effort=[0.5, 0.5])
    assert rig.currents[0] > 0.0
    assert [one.trips for one in rig.driver.health] == [1, 1]


@given(st.floats(-4.0, 4.0), st.floats(-5.0, 5.0))
def test_no_effort_drives_further_into_a_limit(angle, effort):
    servo, parameters = described().servos[0], ArmDriverParameters()
    raw = goal_current(servo, effort, 0.0, angle, parameters)
    assert not (angle >= servo.high and raw > 0) and not (angle <= servo.low and raw < 0)
    if servo.low < angle < servo.high or angle * effort < 0.0:
        assert raw == servo.current(effort)


@given(st.floats(-10.0, 10.0), st.sampled_from([1, -1]), st.sampled_from([0, 4096, -4096]))
def test_goal_positions_are_clamped(goal, direction, turns):
    servo = dataclasses.replace(described().servos[0], direction=direction)
    angle = servo.angle(goal_position(servo, goal, turns) + turns)
    half = math.pi / 4096 + 1e-9
    assert servo.low - half <= angle <= servo.high + half
    if servo.low <= goal <= servo.high:
        assert abs(angle - goal) <= half


def test_a_limit_is_enforced_on_the_wire():
    high = described().servos[0].high
    rig = ArmRig([StillShaft(high + 0.01), StillShaft(STOWED[1])]).start()
    rig.cycle(3, effort=[0.5, 0.5])
    assert rig.currents[0] == 0.0 < rig.currents[1]
    rig.cycle(1, effort=[-0.5, 0.5])
    assert rig.currents[0] < 0.0


def test_the_current_is_limited_and_counted():
    rig = ArmRig().start()
    rig.cycle(3, effort=[50.0, 0.0])
    assert rig.currents[0] == pytest.approx(855 * 0.00269)
    assert rig.driver.saturated == 3


def test_friction_is_compensated_only_when_it_is_on():
    chain = {"coulomb": 0.2, "viscous": 0.1}
    for on, expected in ((False, 0.5), (True, 0.5 + 0.2 + 0.1)):
        rig = ArmRig(chain=chain, friction_compensation=on).start()
        rig.cycle(3, effort=[0.5, 0.5], velocity=[1.0, 1.0])
        assert rig.currents[0] * 1.304 == pytest.approx(expected, abs=UNIT)


def test_a_lost_servo_stops_the_joints_and_the_torque_of_the_others():
    rig = ArmRig(missed_reads=4).start()
    rig.cycle(3, effort=[0.5, 0.5])
    rig.servos[1].connected = False
    assert rig.cycle(3, effort=[0.5, 0.5]) is None
    assert rig.driver.lost == [] and rig.currents[0] > 0.0  # a few misses are none
    assert rig.cycle(2, effort=[0.5, 0.5]) is None
    assert rig.driver.problems == [
        "alpha_2 (id 2): no answer to the last 5 reads: cable, supply, id?"
    ]
    assert rig.currents[0] == 0.0


def test_a_servo_that_comes_back_from_a_power_loss_is_prepared_again():
    rig = ArmRig(missed_reads=4).start()
    rig.cycle(3, effort=[0.5, 0.5])
    rig.line.cut_behind(1)
    rig.cycle(6, effort=[0.5, 0.5])
    assert rig.driver.lost
    rig.line.mend()
    assert rig.cycle(3, effort=[0.5, 0.5]) is not None
    assert rig.driver.problems == [] and min(rig.currents) > 0.0


def test_a_restart_too_short_to_be_missed_is_noticed():
    rig = ArmRig(slow_interval=0.004).start()
    rig.cycle(3, effort=[0.5, 0.5])
    rig.servos[0].restart()
    assert rig.currents[0] is None
    rig.cycle(12, effort=[0.5, 0.5])
    assert rig.currents[0] > 0.0
    assert [one.restarts for one in rig.driver.health] == [1, 0]


def test_a_hardware_error_is_named_at_once_and_rebooted_on_request_only():
    rig = ArmRig().start()
    rig.cycle(3, effort=[0.5, 0.5])
    rig.servos[0].raise_error("overload")
    assert rig.cycle(1, effort=[0.5, 0.5]) is not None  # the angles go on
    (line,) = rig.driver.problems
    assert line.startswith("alpha_1 (id 1): overload (torque above the servo's ability")
    rig.cycle(200, effort=[0.5, 0.5])
    assert rig.currents[0] is None
    assert rig.driver.reboot() == ["alpha_1 (id 1): rebooted after overload"]
    rig.cycle(2, effort=[0.5, 0.5])
    assert rig.driver.problems == [] and rig.currents[0] > 0.0
    assert rig.driver.reboot() == []


def test_an_overheated_servo():
    rig = ArmRig(slow_interval=0.004).start()
    rig.servos[1].temperature = 78.0
    rig.cycle(12)
    assert rig.driver.health[1].temperature == 78.0 and rig.driver.problems == []
    rig.servos[1].temperature = 82.0
    rig.cycle(2)
    assert "alpha_2 (id 2): overheating (let it cool" in rig.driver.problems[0]


def test_an_error_from_before_the_start_keeps_the_torque_off():
    rig = ArmRig()
    rig.servos[0].raise_error("encoder")
    rig.start()
    rig.cycle(3, effort=[0.5, 0.5])
    assert rig.currents[0] is None and rig.currents[1] > 0.0
    assert any("alpha_1 (id 1): encoder" in one for one in rig.driver.remarks)


def test_a_lost_device_is_opened_again():
    rig = ArmRig(reopen_interval=0.1).start()
    rig.cycle(3, effort=[0.5, 0.5])
    rig.port.plugged = False
    assert rig.cycle(50, effort=[0.5, 0.5]) is None
    assert rig.driver.problems == ["line: Input/output error"]
    assert rig.currents == [0.0, 0.0]  # by the servos' watchdog
    rig.port.plugged = True
    reading = rig.cycle(60, effort=[0.5, 0.5])
    assert reading is not None and rig.driver.problems == [] and min(rig.currents) > 0.0


def test_old_firmware_is_read_without_the_fast_read():
    rig = ArmRig()
    for servo in rig.servos:
        servo.set("Firmware Version", 44)
    rig.start()
    rig.cycle(2)
    assert any("firmware 44 has no Fast Sync Read" in one for one in rig.driver.remarks)
    assert not any(packet[7] == 0x8A for packet in rig.port.written)
    assert rig.driver.budget.items[1].name == "Sync Read of the states"


@pytest.mark.parametrize("ends_with", ["torque_off", "hold"])
def test_the_end(ends_with):
    rig = ArmRig([StillShaft(0.3), StillShaft(STOWED[1])], ends_with=ends_with).start()
    rig.cycle(3, effort=[0.5, 0.5])
    rig.driver.stop()
    rig.clock.now += 10.0  # no watchdog
    rig.line.tick()
    for shaft in rig.shafts:
        assert shaft.last.on == (ends_with == "hold")
        if shaft.last.on:
            assert shaft.last.mode == 5
            assert shaft.last.position == pytest.approx(shaft.angle, abs=2e-3)


def test_position_mode():
    rig = ArmRig(mode="position").start()
    rig.driver.command_position(np.array([math.nan, 0.5]))
    rig.cycle(2)
    assert rig.shafts[0].last.position == pytest.approx(STOWED[0], abs=2e-3)  # no goal: it holds
    rig.driver.command_position(np.array([0.25, 9.0]))
    rig.cycle(50)  # a goal stays when no new one comes
    found = [shaft.last.position for shaft in rig.shafts]
    assert found == pytest.approx([0.25, described().servos[1].high], abs=2e-3)
    assert all(shaft.last.mode == 3 for shaft in rig.shafts)
    assert rig.servos[0].get("Position P Gain") == 800


def test_position_mode_needs_the_range_within_a_turn():
    with pytest.raises(ArmError, match="position mode has 0 to 4095: mount the horn"):
        ArmRig(mode="position", chain={"zero": 300})


def test_a_zero_near_the_end_of_the_turn_is_read_in_the_right_turn():
    rig = ArmRig([StillShaft(math.pi - 0.1), StillShaft(STOWED[1])], chain={"zero": 0})
    rig.driver.start()
    rig.servos[1].shaft.angle = math.pi / 2 - math.pi
    reading = rig.cycle(2)
    assert reading.position == pytest.approx([-0.1, math.pi / 2], abs=2e-3)


@settings(max_examples=25)
@given(st.integers(0, 1000), st.sampled_from([1e-4, 1e-3]), st.sampled_from([0.0, 0.02]))
def test_with_bit_errors_and_losses_every_reading_is_right(seed, rate, loss):
    rig = ArmRig(seed=seed).start()
    rig.line.bit_error_rate, rig.line.loss = rate, loss
    right = 0
    for _ in range(60):
        reading = rig.cycle(1, effort=[0.4, -0.4])
        if reading is not None:
            right += 1
            assert reading.position == pytest.approx(STOWED, abs=2e-3)
    assert right > 30
    sizes = [0.0 if current is None else abs(current) * 1.304 for current in rig.currents]
    assert all(min(size, abs(size - 0.4)) < UNIT for size in sizes)


def test_the_slow_values_are_read_in_turn():
    rig = ArmRig(slow_interval=0.04).start()
    before = len(rig.port.written)
    rig.cycle(100)
    slow = [packet for packet in rig.port.written[before:] if packet[7] == 0x02]
    assert len(slow) == pytest.approx(10, abs=1)
    for health in rig.driver.health:
        assert (health.temperature, health.voltage) == (35.0, 12.0) and health.torque_on


def test_the_rate_is_measured():
    rig = ArmRig().start()
    rig.driver.meter.report()
    rig.cycle(100)
    assert rig.driver.meter.report()[0] == pytest.approx(250.0)


def test_a_slow_adapter_and_a_slow_bus_are_remarked():
    rig = ArmRig(rate=1000.0)
    rig.driver.latency_timer = 0.016
    rig.driver.start()
    text = "\n".join(rig.driver.remarks)
    assert "line: latency timer 16 ms, 1 ms is needed: echo 1 | sudo tee /sys/bus" in text
    assert "line: the bus carries 30 Hz, 1000 Hz is needed" in text


def test_every_parameter_is_described_and_ranged():
    for name, spec in ArmDriverParameters.specs().items():
        assert spec.description, name
    assert ArmDriverParameters().validated() == ArmDriverParameters()


def test_a_device_that_does_not_exist():
    driver = ArmDriver(described("/dev/ttyNONE"), ArmDriverParameters())
    with pytest.raises(BusLost, match="/dev/ttyNONE: does not exist"):
        driver.start()


def test_the_whole_driver_behind_a_device(tmp_path):
    """Over a pseudo-terminal, unplugged and plugged in again."""
    shafts = [StillShaft(angle) for angle in STOWED]
    servos = [EmulatedServo(i + 1, one, baud_rate=BAUD) for i, one in enumerate(shafts)]
    with closing(EmulatedBus(servos, link=tmp_path / "ttyARM")) as device:
        parameters = ArmDriverParameters(
            answer_timeout=PATIENT, reopen_interval=0.01, effort_timeout=PATIENT, watchdog=2.5
        )
        driver = ArmDriver(described(device.port), parameters)
        driver.start()

        def until(condition):
            end = time.monotonic() + PATIENT
            while time.monotonic() < end:
                driver.command_effort([0.5, -0.5])
                if condition(driver.cycle()):
                    return
                time.sleep(0.001)
            raise AssertionError(driver.problems)

        until(lambda reading: reading is not None and abs(reading.effort[0] - 0.5) < 0.01)
        device.unplug()
        assert driver.cycle() is None and "ttyARM" in driver.problems[0]
        device.plug_in()
        until(lambda reading: reading is not None and not driver.problems)
        driver.stop()
        assert not any(shaft.last.on for shaft in shafts)


def test_a_released_arm_has_no_torque_and_is_driven_again_afterwards():
    rig = ArmRig().start()
    rig.cycle(2, effort=[0.5, 0.5])
    assert min(rig.currents) > 0.0
    assert rig.driver.release(True) == ""
    rig.cycle(3, effort=[0.5, 0.5])
    assert rig.currents == [0.0, 0.0]
    rig.driver.release(False)
    rig.cycle(2, effort=[0.5, 0.5])
    assert min(rig.currents) > 0.0


def test_in_position_mode_a_released_arm_has_its_torque_off():
    rig = ArmRig(mode="position").start()
    rig.driver.command_position(np.array(STOWED))
    rig.cycle(2)
    assert rig.driver.release(True) == ""
    rig.cycle(20)  # the slow reads see it, too
    assert [shaft.last.on for shaft in rig.shafts] == [False, False]
    assert not rig.driver.problems
    rig.driver.release(False)
    rig.cycle(2)
    assert [shaft.last.on for shaft in rig.shafts] == [True, True]
