"""The described chain: conversions, and mistakes of the lab file named in one line."""

import dataclasses
import math

import pytest
import yaml
from arm_rig import described
from hypothesis import given
from hypothesis import strategies as st

from uam_control.settings.section import Section
from uam_control.vehicle import load_description
from uam_sim_bridge.devices.dynamixel.budget import budget
from uam_sim_bridge.devices.dynamixel.chain import ArmError, describe_chain, hardware_file
from uam_sim_bridge.devices.dynamixel.driver import friction_torque
from uam_sim_bridge.devices.serial.serial_port import latency_timer

VEHICLE = load_description()
SERVO = described().servos[0]


def document(**changes):
    """The lab file with changes of the first servo or, by arm__NAME, of the section."""
    found = yaml.safe_load(hardware_file("s500_lab").read_text())
    for name, value in changes.items():
        where = found["arm"] if name.startswith("arm__") else found["arm"]["servos"][0]
        name = name.removeprefix("arm__")
        where.pop(name, None) if value is None else where.update({name: value})
    return found


def read(**changes):
    return describe_chain(Section(document(**changes), "my_lab.yaml:", ArmError), VEHICLE)


def test_the_files_chain_has_the_numbers_of_the_vehicle():
    chain = read()
    assert chain.joint_names == VEHICLE.joint_names and chain.ids == (1, 2)
    first = chain.servos[0]
    assert first.torque_constant == VEHICLE.numbers["servos"]["torque_per_current"]
    assert first.current_unit == VEHICLE.numbers["servos"]["current_unit"]
    assert (first.low, first.high) == (VEHICLE.joints[0].low, VEHICLE.joints[0].high)
    assert first.current_limit_counts == int(2.3 / 0.00269)


def test_the_order_is_that_of_the_vehicle():
    swapped = document()
    swapped["arm"]["servos"].reverse()
    assert describe_chain(Section(swapped, "f:", ArmError), VEHICLE) == read()


def test_a_reversed_geared_servo_by_hand():
    """Gear 2, direction -1, zero 1000: half a turn of the servo, 2048 counts, is -90 deg."""
    servo = read(direction=-1, zero=1000, gear=2.0, torque_scale=0.9, range_deg=[-95, 80]).servos[0]
    assert servo.angle(3048) == pytest.approx(-math.pi / 2)
    assert servo.counts(-math.pi / 2) == 3048
    assert servo.velocity(100) == pytest.approx(-100 * servo.table.velocity_unit / 2)
    assert servo.effort(100) == pytest.approx(-0.269 * 1.304 * 0.9 * 2)
    assert servo.current(servo.effort(100)) == 100


@given(
    st.sampled_from([1, -1]),
    st.integers(-4096, 8192),
    st.floats(0.5, 5.0),
    st.integers(-20000, 20000),
)
def test_angles_and_counts_are_inverse(direction, zero, gear, counts):
    servo = dataclasses.replace(SERVO, direction=direction, zero=zero, gear=gear)
    assert servo.counts(servo.angle(counts)) == counts


@given(st.floats(-50.0, 50.0), st.sampled_from([1, -1]))
def test_the_current_is_within_its_limit_and_half_a_unit(effort, direction):
    servo = dataclasses.replace(SERVO, direction=direction)
    raw = servo.current(effort)
    assert abs(raw) <= servo.current_limit_counts
    if abs(raw) < servo.current_limit_counts:
        assert abs(servo.effort(raw) - effort) <= 0.5001 * 0.00269 * servo.torque_constant


@given(st.integers(0, 4095), st.integers(0, 4095))
def test_a_position_within_one_turn_gets_the_turn_of_the_range(zero, counts):
    servo = dataclasses.replace(SERVO, zero=zero)
    angle = servo.angle(counts + servo.turned(counts))
    assert abs(angle - 0.5 * (servo.low + servo.high)) <= math.pi + 0.001


MISTAKES = [
    ({"model": "xm999"}, "arm.servos[0].model: unknown servo model 'xm999'"),
    ({"model": "xl430_w250"}, "arm.servos[0].model: xl430_w250 has no register 'Goal Current'"),
    ({"direction": 0}, "arm.servos[0].direction: 0 is not one of 1, -1"),
    ({"direction": 2}, "arm.servos[0].direction: a whole number expected, -1 to 1, got 2"),
    ({"id": 253}, "arm.servos[0].id: a whole number expected, 0 to 252, got 253"),
    ({"id": 2}, "arm.servos: ids 2, 2: each servo needs its own"),
    ({"joint": "elbow"}, "arm.servos: joints elbow, alpha_2; the vehicle has alpha_1, alpha_2"),
    ({"gear": 0.0}, "arm.servos[0].gear: 0 is not above 0"),
    (  # 220 deg of the joint
        {"gear": 1.8},
        "gear: 1.8 makes the joint's 220 deg 1.1 turns of the servo; less than one is "
        "possible: below 1.64, or a narrower range_deg",
    ),
    ({"zero": None}, "arm.servos[0].zero is missing"),
    ({"coulomb": -0.1}, "arm.servos[0].coulomb: -0.1 is below 0"),
    ({"current_limit": 100.0}, "arm.servos[0].current_limit: 100 A is beyond the register"),
    ({"range_deg": [-120, 90]}, "range_deg: not an interval within the vehicle's -110 to 110"),
    ({"arm__baud_rate": 1234}, "arm.baud_rate: 1234 is not one of 9600, 57600, 115200, 1000000"),
    ({"arm__return_delay_us": 3}, "arm.return_delay_us: 3 is odd; the servos' unit is 2 us"),
    ({"arm__device": None}, "arm.device is missing"),
]


@pytest.mark.parametrize("changes, text", MISTAKES, ids=lambda value: str(value)[:30])
def test_mistakes_are_refused_in_one_line(changes, text):
    with pytest.raises(ArmError) as refused:
        read(**changes)
    assert text in str(refused.value) and "\n" not in str(refused.value)
    assert str(refused.value).startswith("my_lab.yaml: ")


def test_a_joint_may_have_narrower_limits():
    assert read(range_deg=[-20, 30]).servos[0].high == pytest.approx(math.radians(30))


def test_the_budget_by_hand():
    """Two servos, 1 Mbaud, fast: 14 + 2 * 3 bytes out; 14 + 2 out, 8 + 2 * 14 in; 10 us a byte."""
    made = budget(2, 1_000_000, 0.0, 0.001, fast=True, slow_every=10)
    assert made.cycle == pytest.approx(10e-6 * (20 + 16 + 36) + 0.001)
    assert made.longest == pytest.approx(made.cycle + 10e-6 * (14 + 18) + 0.001)
    assert made.rate == pytest.approx(1.0 / made.longest)
    assert "DOES NOT FIT" not in made.table(250.0)
    assert "DOES NOT FIT" in budget(2, 57600, 500e-6, 0.016, False, 10).table(250.0)


@pytest.mark.parametrize("fast", [True, False])
@given(
    servos=st.integers(1, 8),
    baud=st.sampled_from([57600, 1_000_000, 4_000_000]),
    delay=st.floats(0, 500e-6),
)
def test_the_budget_grows_with_servos_and_delay(fast, servos, baud, delay):
    one = budget(servos, baud, delay, 0.001, fast, 10)
    assert budget(servos + 1, baud, delay, 0.001, fast, 10).cycle > one.cycle
    assert budget(servos, baud, delay + 1e-4, 0.001, fast, 10).cycle > one.cycle
    assert budget(servos, 57600, delay, 0.001, fast, 10).cycle >= one.cycle


def test_the_latency_timer_is_read(tmp_path):
    place = tmp_path / "sys/ttyUSB7"
    place.mkdir(parents=True)
    (place / "latency_timer").write_text("16\n")
    link = tmp_path / "by-id"
    link.symlink_to("/dev/ttyUSB7")
    assert latency_timer(str(link), tmp_path / "sys") == pytest.approx(0.016)
    assert latency_timer("/dev/pts/3", tmp_path / "sys") is None


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(-5.0, 5.0))
def test_friction_opposes_no_motion_and_is_odd(coulomb, viscous, velocity):
    torque = friction_torque(coulomb, viscous, velocity, 0.1)
    assert torque == -friction_torque(coulomb, viscous, -velocity, 0.1)
    assert torque * velocity >= 0.0
    assert abs(torque) <= coulomb + viscous * abs(velocity) + 1e-12


def test_friction_by_hand():
    assert friction_torque(0.2, 0.5, 2.0, 0.1) == pytest.approx(1.2)
    assert friction_torque(0.2, 0.0, 0.1, 0.1) == pytest.approx(0.2 * math.tanh(1.0))
