"""The emulated servos, asked by the maker's library: access rights, errors, watchdog, faults."""

import math
import random
import time
from contextlib import closing

import pytest
from arm_rig import BAUD, PATIENT, ArmRig, LinePort, described, raw_bus
from dynamixel_sdk import COMM_SUCCESS, GroupSyncRead, PortHandler, Protocol2PacketHandler
from hypothesis import given
from hypothesis import strategies as st
from servo_shafts import FrictionShaft, StillShaft
from set_clock import SetClock

from uam_sim_bridge.devices.dynamixel.bus import BusLost, DynamixelBus, NoAnswer, Refused
from uam_sim_bridge.devices.dynamixel.control_table import (
    ControlTableError,
    control_table,
    model_numbers,
)
from uam_sim_bridge.devices.dynamixel.emulated import (
    ArmShafts,
    Drive,
    EmulatedBus,
    EmulatedServo,
    ServoLine,
)
from uam_sim_bridge.devices.dynamixel.health import ERRORS, advice, hardware_errors
from uam_sim_bridge.devices.dynamixel.protocol import word
from uam_sim_bridge.devices.serial.serial_port import SerialPort

TABLE = control_table("xm430_w210")
TORQUE, MODE, CURRENT = TABLE["Torque Enable"], TABLE["Operating Mode"], TABLE["Goal Current"]
WATCHDOG = TABLE["Bus Watchdog"]


@pytest.fixture
def clock():
    return SetClock(100.0)


@pytest.fixture
def line(clock):
    shafts = [StillShaft(0.0), StillShaft(1.0, velocity=-2.0)]
    return ServoLine(
        [EmulatedServo(i + 1, one, baud_rate=BAUD, clock=clock) for i, one in enumerate(shafts)]
    )


@pytest.fixture
def bus(line):
    return raw_bus(line)


def in_current_mode(bus, servo=1):
    bus.write(servo, MODE, 0)
    bus.write(servo, TORQUE, 1)


def test_the_makers_files_are_read():
    """Addresses and units of the XM430-W210 by the e-manual."""
    assert TABLE.number == 1030 and TABLE.counts_per_turn == 4096
    assert TABLE.velocity_unit == pytest.approx(0.229 * 2 * math.pi / 60, rel=1e-3)
    addresses = {"Goal Current": (102, 2), "Present Position": (132, 4), "Bus Watchdog": (98, 1)}
    assert {n: (TABLE[n].address, TABLE[n].size) for n in addresses} == addresses
    span = TABLE.span("Present Current", "Present Velocity", "Present Position")
    assert (span.address, span.size) == (126, 10)


@pytest.mark.parametrize("model", [name for name in model_numbers() if name.startswith("x")])
def test_every_model_of_the_x_series_has_its_table_or_is_refused(model):
    try:
        assert control_table(model)["Torque Enable"].size == 1
    except ControlTableError as error:
        assert model.startswith("xd540") and "has no control table" in str(error)


def test_an_unknown_model_or_register_is_refused_in_one_line():
    with pytest.raises(
        ControlTableError, match="unknown servo model 'xm1'; X series: xl320, xh430"
    ):
        control_table("xm1")
    with pytest.raises(ControlTableError, match="xm430_w210 has no register 'Goal Torque'"):
        TABLE["Goal Torque"]


@given(st.integers(1, 4), st.data())
def test_a_signed_value_is_its_bytes(size, data):
    value = data.draw(st.integers(-(1 << 8 * size - 1), (1 << 8 * size - 1) - 1))
    assert int.from_bytes(word(value, size), "little", signed=True) == value


def test_ping_scan_and_states(bus):
    assert bus.ping(2) == 1030
    assert bus.scan() == {1: (1030, 50), 2: (1030, 50)}
    with pytest.raises(NoAnswer, match="id 9: no answer"):
        bus.ping(9)
    assert bus.read_signed(2, TABLE["Present Position"]) == 2048 + round(4096 / (2 * math.pi))
    assert bus.read_signed(2, TABLE["Present Velocity"]) == round(-2.0 / TABLE.velocity_unit)


@pytest.mark.parametrize("fast", [False, True])
def test_sync_read_brings_every_servo(bus, line, fast):
    span = TABLE.span("Present Current", "Present Position")
    found = bus.sync_read(span, [2, 1], fast)
    assert sorted(found) == [1, 2]
    position = int.from_bytes(found[2][6:10], "little")
    assert position == bus.read(2, TABLE["Present Position"])
    line.servos[0].connected = False  # named second: it spoils the common packet only
    assert sorted(bus.sync_read(span, [2, 1], fast)) == ([] if fast else [2])
    assert bus.sync_read(span, [1, 2], fast) == {}  # the second waits for the first


class SdkPort(PortHandler):
    """The line as a port of the maker's library."""

    def __init__(self, line):
        super().__init__("line")
        self.joined = LinePort(line)
        self.joined.open(BAUD)

    def clearPort(self):
        pass

    def writePort(self, packet):
        self.joined.send(bytes(packet))
        return len(packet)

    def readPort(self, length):
        data = self.joined.received[:length]
        self.joined.received = self.joined.received[length:]
        return data


def test_the_librarys_own_sync_read_agrees(line):
    port = SdkPort(line)
    group = GroupSyncRead(port, Protocol2PacketHandler(), 126, 10)
    group.addParam(1)
    group.addParam(2)
    for read in (group.txRxPacket, group.fastSyncRead):
        assert read() == COMM_SUCCESS
        assert group.getData(1, 132, 4) == 2048


def test_eeprom_is_locked_while_torque_is_on(bus):
    in_current_mode(bus)
    with pytest.raises(Refused, match="id 1: not accessible; EEPROM is locked while torque is on"):
        bus.write(1, MODE, 3)
    bus.write(1, TORQUE, 0)
    bus.write(1, MODE, 3)
    assert bus.read(1, MODE) == 3


@pytest.mark.parametrize(
    "name, value, reason",
    [
        ("Present Position", 5, "not accessible"),
        ("Goal Current", 1194, "beyond its limit register"),
        ("Operating Mode", 2, "out of range"),
        ("Bus Watchdog", 128, "out of range"),
    ],
)
def test_wrong_writes_are_refused_and_change_nothing(bus, name, value, reason):
    before = bus.read(1, TABLE[name])
    with pytest.raises(Refused, match=reason):
        bus.write(1, TABLE[name], value)
    assert bus.read(1, TABLE[name]) == before


def test_the_current_reaches_the_shaft_and_is_measured(bus, line):
    in_current_mode(bus)
    bus.sync_write(CURRENT, {1: -100, 2: 50})
    assert line.servos[0].shaft.last.current == pytest.approx(-0.269)
    assert bus.read_signed(1, TABLE["Present Current"]) == -100
    assert not line.servos[1].shaft.last.on


def test_the_watchdog_stops_a_servo_whose_host_is_silent(bus, line, clock):
    in_current_mode(bus)
    bus.write(1, WATCHDOG, 5)  # 100 ms
    bus.write(1, CURRENT, 100)
    clock.now += 0.09
    bus.ping(2)  # any instruction on the bus counts
    clock.now += 0.09
    line.tick()
    assert line.servos[0].shaft.last.current == pytest.approx(0.269)
    clock.now += 0.02
    line.tick()
    assert line.servos[0].shaft.last.current == 0.0
    assert bus.read(1, WATCHDOG) == 255
    with pytest.raises(Refused, match="out of range"):
        bus.write(1, CURRENT, 100)
    bus.write(1, WATCHDOG, 0)
    bus.write(1, CURRENT, 100)
    assert line.servos[0].shaft.last.current == pytest.approx(0.269)


def test_a_hardware_error_keeps_the_torque_off_until_a_reboot(bus, line):
    in_current_mode(bus)
    line.servos[0].temperature = 81.0  # above Temperature Limit
    bus.read(1, TABLE["Present Temperature"])
    assert bus.ping(1) and bus.alerts == {1}
    assert hardware_errors(bus.read(1, TABLE["Hardware Error Status"])) == ["overheating"]
    assert not line.servos[0].shaft.last.on
    line.servos[0].temperature = 40.0
    with pytest.raises(Refused, match="could not execute"):
        bus.write(1, TORQUE, 1)
    bus.reboot(1)
    bus.write(1, TORQUE, 1)
    assert bus.read(1, TABLE["Hardware Error Status"]) == 0 and bus.alerts == set()
    assert bus.read(1, MODE) == 0  # EEPROM stays


def test_an_error_outside_the_shutdown_register_leaves_the_torque(bus, line):
    in_current_mode(bus)
    line.servos[0].voltage = 9.0
    bus.read(1, TABLE["Present Input Voltage"])
    assert hardware_errors(bus.read(1, TABLE["Hardware Error Status"])) == ["input voltage"]
    assert line.servos[0].shaft.last.on


@given(st.sets(st.sampled_from(list(ERRORS))))
def test_errors_in_words(errors):
    status = sum(1 << ERRORS[one][0] for one in errors)
    assert set(hardware_errors(status)) == errors
    assert all(one in advice(status) for one in errors)


def test_an_unknown_error_bit_is_shown():
    assert hardware_errors(0x42) == ["unknown error 0x42"]


def test_two_servos_of_one_id_damage_each_other(line, bus):
    line.servos[1].set("ID", 1)
    line.servos[1].set("Firmware Version", 45)
    with pytest.raises(NoAnswer, match="damaged|no answer"):
        bus.ping(1)


def test_another_baud_rate_is_not_understood(line, bus):
    line.servos[0].set("Baud Rate", 1)
    with pytest.raises(NoAnswer):
        bus.ping(1)
    assert bus.ping(2) == 1030


@pytest.mark.parametrize("rate", [1e-4, 1e-3, 1e-2])
def test_bit_errors_never_give_a_wrong_value(line, bus, rate):
    """What passes the CRC is right; the share of the rest agrees with the rate."""
    line.bit_error_rate = rate
    span, right = TABLE.span("Present Current", "Present Position"), 0
    expected = line.servos[0].read(span.address, span.size)[1]
    for _ in range(400):
        found = bus.sync_read(span, [1], fast=False)
        assert found in ({}, {1: expected})
        right += bool(found)
    bits = 8 * (15 + 21)
    assert right / 400 == pytest.approx((1.0 - rate) ** bits, abs=0.08)


def test_lost_packets_are_lost_by_the_seed(clock):
    def answered(seed):
        servo = EmulatedServo(1, StillShaft(), baud_rate=BAUD, clock=clock)
        line = ServoLine([servo], seed)
        line.loss = 0.3
        bus = raw_bus(line)
        return [bool(bus.sync_read(TORQUE, [1], False)) for _ in range(40)]

    assert answered(1) == answered(1) != answered(2)
    assert 5 < sum(answered(1)) < 35


def test_a_cut_chain_loses_the_supply_behind_the_cut(bus, line):
    in_current_mode(bus, 2)
    line.cut_behind(1)
    assert bus.ping(1) == 1030
    with pytest.raises(NoAnswer):
        bus.ping(2)
    line.mend()
    assert bus.read(2, TORQUE) == 0  # it has restarted


def test_a_joint_with_friction_stays_and_slides(clock):
    shaft = FrictionShaft(0.01, 0.2, 0.1, torque_constant=1.0, weight=0.0, clock=clock)

    def wait(seconds):
        for _ in range(round(seconds / 0.01)):
            clock.now += 0.01
            shaft.sense()

    shaft.drive(Drive(on=True, current=0.19))
    wait(0.5)
    assert shaft.sense() == (0.0, 0.0, 0.19)
    shaft.drive(Drive(on=True, current=0.5))
    wait(3.0)
    assert shaft.velocity == pytest.approx((0.5 - 0.2) / 0.1, rel=1e-3)
    shaft.drive(Drive())
    wait(3.0)
    assert shaft.sense()[1:] == (0.0, 0.0)


@pytest.mark.parametrize("mode", ["current", "position"])
def test_the_joints_of_a_plant_behind_geared_reversed_servos(mode):
    """What the plant has is what the driver reads, and what the driver commands arrives."""
    mounted = {"direction": -1, "gear": 1.2, "zero": 2000, "torque_constant": 1.5}
    arm = ArmShafts(described(**mounted).servos)
    arm.set([0.3, 1.2], [0.5, -0.5], [0.2, -0.1])
    rig = ArmRig(arm.shafts, chain=mounted, mode=mode).start()
    reading = rig.cycle(1)
    assert reading.position == pytest.approx([0.3, 1.2], abs=2e-3)
    assert reading.velocity == pytest.approx([0.5, -0.5], abs=0.02)
    assert reading.effort == pytest.approx([0.2, -0.1], abs=0.003)
    if mode == "current":
        rig.cycle(2, effort=[0.4, -0.7])
        assert arm.command(False) == pytest.approx([0.4, -0.7], abs=0.003)
        rig.driver.stop()
        assert arm.command(False) == pytest.approx([0.0, 0.0])
    else:
        rig.driver.command_position([-0.4, 0.7])
        rig.cycle(2)
        assert arm.command(True) == pytest.approx([-0.4, 0.7], abs=2e-3)
        rig.driver.stop()
        assert all(math.isnan(goal) for goal in arm.command(True))


@given(st.integers(0, 65535), st.integers(0, 400), st.binary(max_size=20))
def test_no_instruction_breaks_a_servo(address, length, data):
    servo = EmulatedServo(1, StillShaft())
    servo.read(address, length)
    servo.write(address, data)
    assert servo.read(7, 1)[0] in (0, 0x80)


# ---- behind a pseudo-terminal


@pytest.fixture
def device(tmp_path):
    servos = [EmulatedServo(i, StillShaft(0.1 * i), baud_rate=BAUD) for i in (1, 2, 3)]
    with closing(EmulatedBus(servos, link=tmp_path / "ttyARM")) as made:
        yield made


def test_the_library_reads_servos_behind_a_device(device):
    bus = DynamixelBus(device.port, BAUD, PATIENT)
    bus.open()
    order = random.Random(1)
    for _ in range(30):
        ids = order.sample([1, 2, 3], 3)
        found = bus.sync_read(TABLE["Present Position"], ids, fast=bool(order.getrandbits(1)))
        assert {servo: int.from_bytes(data, "little") for servo, data in found.items()} == {
            servo: 2048 + round(0.1 * servo * 4096 / (2 * math.pi)) for servo in (1, 2, 3)
        }
    bus.close()


def test_the_answers_take_their_time_on_the_wire():
    """At 57600 baud, with return delay and latency timer; a sleep is never too short."""
    servo = EmulatedServo(1, StillShaft())
    with closing(EmulatedBus([servo], timing=True, latency_timer=0.016)) as device:
        bus = DynamixelBus(device.port, 57600, PATIENT)
        bus.open()
        begun = time.monotonic()
        bus.read(1, TABLE["Present Position"])
        taken = time.monotonic() - begun
        bus.close()
    assert taken >= (14 + 15) * 10 / 57600 + 500e-6 + 0.016


def test_the_speed_of_the_host_is_that_of_the_device(device):
    bus = DynamixelBus(device.port, 57600, 0.05)
    bus.open()
    with pytest.raises(NoAnswer):
        bus.ping(1)
    bus.close()


def test_unplug_and_plug_in(device):
    bus = DynamixelBus(device.port, BAUD, PATIENT)
    bus.open()
    bus.ping(1)
    device.unplug()
    with pytest.raises(BusLost, match="ttyARM: "):
        bus.ping(1)
    bus.close()
    with pytest.raises(BusLost, match="ttyARM: does not exist"):
        bus.open()
    device.plug_in()
    bus.open()
    assert bus.ping(1) == 1030
    bus.close()


def test_the_port_waits_no_longer_than_for_its_bytes(device):
    """Bytes sent and expected, and the allowance."""
    port = SerialPort(device.port, allowance=0.002)
    port.open(1_000_000)  # 10 us for a byte
    port.send(bytes(20))
    assert port.expect(30) == pytest.approx(0.0005 + 0.002)
    assert port.expect(30) == pytest.approx(0.0003 + 0.002)
    port.close()
