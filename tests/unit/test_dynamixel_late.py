"""Late answers of servos: an answer that was given up is never taken for another one."""

from arm_rig import BAUD, ArmRig, LinePort
from hypothesis import given
from hypothesis import strategies as st
from servo_shafts import StillShaft
from set_clock import SetClock

from uam_sim_bridge.devices.dynamixel.bus import (
    LATEST,
    DynamixelBus,
    Instruction,
    NoAnswer,
    Overdue,
)
from uam_sim_bridge.devices.dynamixel.control_table import control_table
from uam_sim_bridge.devices.dynamixel.emulated import EmulatedServo, ServoLine
from uam_sim_bridge.devices.dynamixel.protocol import READ, Packet

TABLE = control_table("xm430_w210")
# of one byte, two and four: each with another content
CONTENTS = {
    "ID": 1,
    "Operating Mode": 0,
    "Return Delay Time": 7,
    "Status Return Level": 2,
    "Temperature Limit": 80,
    "Current Limit": 1193,
    "Max Voltage Limit": 160,
    "Velocity Limit": 415,
    "Max Position Limit": 4095,
}
LOST, DAMAGED = "lost", "damaged"


class LatePort(LinePort):
    """An answer comes after so many given-up waits, in the order of the instructions."""

    def __init__(self, line):
        super().__init__(line)
        self.fates = []  # of the next answers: number of waits, LOST or DAMAGED
        self._waits, self._under_way = 0, []

    def send(self, data):
        """The device is not emptied: bytes under way come all the same."""
        before = self.received
        super().send(data)
        answer, self.received = self.received, before
        fate = self.fates.pop(0) if self.fates and answer else 0
        if fate == LOST:
            answer = b""
        elif fate == DAMAGED:
            answer, fate = answer[:-1] + bytes([answer[-1] ^ 1]), 0
        if answer:
            last = self._under_way[-1][0] if self._under_way else 0
            self._under_way.append((max(last, self._waits + fate), answer))
        self._deliver()

    def read(self):
        data = super().read()
        if not data:
            self._waits += 1
            self._deliver()
        return data

    def _deliver(self):
        while self._under_way and self._under_way[0][0] <= self._waits:
            self.received += self._under_way.pop(0)[1]


def late_bus():
    servo = EmulatedServo(1, StillShaft(0.0), baud_rate=BAUD, clock=SetClock(100.0))
    for name, value in CONTENTS.items():
        servo.set(name, value)
    port = LatePort(ServoLine([servo]))
    bus = DynamixelBus("line", BAUD, 0.0, port)
    bus.open()
    return bus, port


fate = st.one_of(st.integers(0, 4), st.sampled_from([LOST, DAMAGED]))


@given(st.lists(st.tuples(st.sampled_from(list(CONTENTS)), fate), min_size=1, max_size=40))
def test_a_value_that_is_returned_is_that_of_its_register(reads):
    bus, port = late_bus()
    for name, happens in reads:
        port.fates = [happens]
        try:
            found = bus.read(1, TABLE[name])
        except NoAnswer:
            continue
        assert found == CONTENTS[name]


def test_the_late_answer_lies_in_front_of_the_next_one():
    bus, port = late_bus()
    port.fates = [1]
    try:
        bus.read(1, TABLE["Return Delay Time"])
        raise AssertionError("an answer that comes later")
    except NoAnswer as error:
        assert not error.damaged
    port._waits, port.fates = 0, []  # it comes behind the look for late ones
    assert bus.read(1, TABLE["Temperature Limit"]) == 80
    assert bus.read(1, TABLE["Operating Mode"]) == 0


def test_after_a_silence_the_bus_answers_as_before():
    bus, port = late_bus()
    for happens in (LOST, LOST, 2, 2):
        port.fates = [happens]
        try:
            bus.read(1, TABLE["Current Limit"])
        except NoAnswer:
            pass
    port.fates = []
    found = []
    for _ in range(8):
        try:
            found.append(bus.read(1, TABLE["Max Voltage Limit"]))
        except NoAnswer:
            pass
    assert len(found) >= 4 and set(found) == {160}


def test_an_overdue_answer_is_forgotten_after_its_time():
    clock = SetClock(100.0)
    overdue, one = Overdue(clock), Instruction(Packet(1, READ, b"\x08\x00\x01\x00"), 1)
    other = Instruction(Packet(1, READ, b"\x09\x00\x01\x00"), 1)
    overdue.add(one)
    assert overdue and not overdue.answers(other, 1, b"\x05", False)  # the late one
    assert not overdue and overdue.answers(other, 1, b"\x05", False)
    overdue.add(one)
    clock.now += LATEST + 0.01
    assert not overdue and overdue.answers(other, 1, b"\x05", False)
    # of another servo, or of another length: not this one's
    assert not overdue.answers(other, 2, b"\x05", False)
    assert not overdue.answers(other, 1, b"\x05\x06", False)
    assert overdue.answers(other, 1, b"", True)  # a refusal has no data


def test_joint_angles_are_never_those_of_another_register():
    rig = ArmRig()
    rig.port.__class__ = LatePort
    rig.port.fates, rig.port._waits, rig.port._under_way = [], 0, []
    rig.start()
    usual = rig.cycle().position
    for happens in (1, 3, LOST, 2, DAMAGED, 4, 1, 1, 2):
        rig.port.fates = [happens] * 3
        for _ in range(4):
            reading = rig.cycle()
            assert reading is None or (reading.position == usual).all()
