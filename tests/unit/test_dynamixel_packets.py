"""Packets of Protocol 2.0 against the maker's library and the manual, any bytes."""

import pytest
from dynamixel_sdk import COMM_SUCCESS, PortHandler, Protocol2PacketHandler
from hypothesis import assume, given
from hypothesis import strategies as st

from uam_sim_bridge.devices.dynamixel import protocol
from uam_sim_bridge.devices.dynamixel.protocol import Packet, PacketReader, crc16

SDK = Protocol2PacketHandler()
PATTERN = b"\xff\xff\xfd"
# bytes of headers and stuffing are frequent, so that the patterns occur
TRICKY = st.lists(
    st.one_of(st.sampled_from([0xFF, 0xFF, 0xFD, 0x00, 0x55]), st.integers(0, 255)), max_size=60
).map(bytes)
IDS = st.integers(0, protocol.LAST_ID)


class MemoryPort(PortHandler):
    """The SDK's port on two byte strings; an answer that is not there is late at once."""

    def __init__(self, answer=b""):
        super().__init__("memory")
        self.sent, self._answer = b"", answer

    def clearPort(self):
        pass

    def writePort(self, packet):
        self.sent += bytes(packet)
        return len(packet)

    def readPort(self, length):
        data, self._answer = self._answer[:length], self._answer[length:]
        return data


def sent_by_sdk(servo, address, data):
    port = MemoryPort()
    SDK.writeTxOnly(port, servo, address, len(data), list(data))
    return port.sent


@given(TRICKY)
def test_the_crc_is_that_of_the_library(data):
    assert crc16(data) == SDK.updateCRC(0, data, len(data))


def test_the_crc_of_the_manuals_example():
    """e-manual, Protocol 2.0, Ping of id 1: FF FF FD 00 01 03 00 01 19 4E."""
    assert Packet(1, protocol.PING).encode().hex(" ") == "ff ff fd 00 01 03 00 01 19 4e"


UNSTUFFED = TRICKY.filter(lambda data: PATTERN not in data)


@given(IDS, st.integers(0, 700), UNSTUFFED)
def test_what_the_library_writes_is_read(servo, address, data):
    (found,) = PacketReader().feed(sent_by_sdk(servo, address, data))
    assert found == Packet(servo, protocol.WRITE, address.to_bytes(2, "little") + data)


@given(IDS, UNSTUFFED)
def test_an_instruction_is_encoded_as_by_the_library(servo, data):
    ours = Packet(servo, protocol.WRITE, (64).to_bytes(2, "little") + data).encode()
    assert ours == sent_by_sdk(servo, 64, data)


@given(IDS, st.integers(0, 255), UNSTUFFED)
def test_a_status_packet_is_read_by_the_library(servo, error, data):
    packet, result = SDK.rxPacket(MemoryPort(protocol.status(servo, error, data)), False)
    assert result == COMM_SUCCESS
    assert (packet[4], packet[8], bytes(packet[9 : 9 + len(data)])) == (servo, error, data)


def test_stuffing_by_the_manual():
    """A byte FD behind each FF FF FD of the content, counted in the length (3 + 2 + 5 + 2)."""
    wire = Packet(1, protocol.WRITE, b"\x40\x00\xff\xff\xfd\x00\x07").encode()
    assert wire[:-2].hex(" ") == "ff ff fd 00 01 0b 00 03 40 00 ff ff fd fd 00 07"


@pytest.mark.parametrize("data", [PATTERN, b"\x01\xff\xff\xfd\x00\xff\xff\xfd\xfd"])
def test_why_the_library_is_not_used(data):
    """It sends the pattern without stuffing; when this fails with a newer one, it may be used."""
    assert sent_by_sdk(1, 64, data) != Packet(1, protocol.WRITE, b"\x40\x00" + data).encode()


@given(IDS, st.integers(0, 255), TRICKY)
def test_a_status_packet_is_read_as_it_was_made(servo, error, data):
    (found,) = PacketReader().feed(protocol.status(servo, error, data))
    assert found == Packet(servo, protocol.STATUS, bytes([error]) + data)


@given(st.lists(st.tuples(IDS, st.sampled_from([0, 0x80])), min_size=1, max_size=6), st.data())
def test_a_fast_status_is_read_by_the_library(servos, data):
    size = data.draw(st.integers(1, 12))
    body = st.binary(min_size=size, max_size=size)
    answers = [(servo, error, data.draw(body)) for servo, error in servos]
    wire = b"".join(protocol.fast_status(answers, len(answers)))
    length = (size + 4) * len(answers)
    found, result, _ = SDK.fastSyncReadRx(MemoryPort(wire), protocol.BROADCAST, length)
    assert result == COMM_SUCCESS
    for i, (servo, error, expected) in enumerate(answers):
        part = found[i * (size + 4) : (i + 1) * (size + 4)]
        assert (part[0], part[1], bytes(part[2:-2])) == (error, servo, expected)
    (ours,) = PacketReader().feed(wire)
    assert ours == Packet(protocol.BROADCAST, protocol.STATUS, wire[8:-2])


@given(st.lists(st.tuples(IDS, TRICKY), max_size=4), st.integers(1, 9), TRICKY)
def test_packets_are_found_in_any_pieces_and_behind_noise(contents, size, noise):
    expected = [Packet(servo, protocol.WRITE, b"\x40\x00" + data) for servo, data in contents]
    expected.append(Packet(7, protocol.PING))
    assume(protocol.HEADER not in noise)
    wire = noise + bytes(4) + b"".join(packet.encode() for packet in expected)
    reader, found = PacketReader(), []
    for start in range(0, len(wire), size):
        found += reader.feed(wire[start : start + size])
    assert found == expected


@given(IDS, TRICKY, st.data())
def test_one_wrong_bit_costs_one_packet_and_no_more(servo, data, choose):
    wire = bytearray(Packet(servo, protocol.WRITE, b"\x40\x00" + data).encode())
    bit = choose.draw(st.integers(0, 8 * len(wire) - 1))
    wire[bit // 8] ^= 1 << bit % 8
    after = Packet(3, protocol.READ, b"\x7e\x00\x0a\x00")
    reader = PacketReader()
    found = reader.feed(bytes(wire) + after.encode())
    assert found == [after]


@given(st.lists(st.binary(max_size=40), max_size=10))
def test_noise_is_survived(chunks):
    reader, whole = PacketReader(), Packet(1, protocol.PING).encode()
    for chunk in chunks:
        reader.feed(chunk)
    found = [packet for _ in range(120) for packet in reader.feed(whole)]
    assert found[-1:] == [Packet(1, protocol.PING)]
