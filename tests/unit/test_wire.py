"""Framing: every valid message is decoded, with any invalid bytes around it."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import development as mavlink2

from uam_control.settings.texts import visible
from uam_sim_bridge.mavlink.protocol.wire import (
    UNREAD,
    Codec,
    Framer,
    TextAssembler,
    clean_text,
    text_chunks,
)


def sample(k):
    """Return a message with content k."""
    if k % 2:
        return mavlink2.MAVLink_attitude_quaternion_message(k, 1, 0, 0, 0, 0.1, 0.2, 0.3)
    return mavlink2.MAVLink_timesync_message(k, 7)


def numbers(messages):
    return [m.time_boot_ms if m.get_type() == "ATTITUDE_QUATERNION" else m.tc1 for m in messages]


def frames(count):
    codec = Codec(1, 1)
    return [codec.encode(sample(k)) for k in range(count)]


def test_sequence_numbers_count_and_wrap():
    assert [f[4] for f in frames(258)] == [*range(256), 0, 1]


@given(st.lists(st.binary(max_size=60), min_size=1, max_size=8), st.integers(1, 50))
def test_stream_survives_garbage_between_messages(garbage, step):
    """With any chunk length all messages arrive in order, once enough bytes follow."""
    good = frames(len(garbage))
    data = b"".join(g + f for g, f in zip(garbage, good, strict=True)) + bytes(300)
    framer = Framer(Codec(2, 2))
    found = []
    for i in range(0, len(data), step):
        found += framer.stream(data[i : i + step])
    assert numbers(found) == list(range(len(garbage)))


@given(st.binary(max_size=40), st.binary(max_size=40))
def test_an_incomplete_frame_is_dropped_with_its_datagram(before, after):
    good = frames(1)[0]
    framer = Framer(Codec(2, 2))
    assert framer.datagram(good[:-5]) == []
    assert numbers(framer.datagram(before + good + after)) == [0]


def test_false_start_that_claims_a_long_frame():
    good = frames(2)
    data = b"\xfd\xff\x00" + good[0] + good[1]
    assert numbers(Framer(Codec(2, 2)).datagram(data)) == [0, 1]


@pytest.mark.parametrize("place", range(4, 30))
def test_a_flipped_bit_is_detected(place):
    good = bytearray(frames(2)[1])
    good[place] ^= 0x10
    framer = Framer(Codec(2, 2))
    found = framer.datagram(bytes(good))
    assert found == [] and framer.bad_bytes == len(good)


def unread_frame(number, payload, sequence=7):
    """Return a frame of a message that pymavlink's dialect omits."""
    body = bytes([len(payload), 0, 0, sequence, 1, 1, *number.to_bytes(3, "little")]) + payload
    crc = mavlink2.x25crc(body + bytes([UNREAD[number]])).crc
    return b"\xfd" + body + crc.to_bytes(2, "little")


@pytest.mark.parametrize("number", UNREAD)
def test_messages_that_the_dialect_omits_are_not_bad_bytes(number):
    good = frames(2)
    framer = Framer(Codec(2, 2))
    other = unread_frame(number, b"\xfd\x03\x00abc")
    assert numbers(framer.datagram(good[0] + other + good[1])) == [0, 1]
    assert framer.bad_bytes == 0 and framer.unread == 1
    damaged = bytearray(other)
    damaged[12] ^= 1
    framer.datagram(bytes(damaged))
    assert framer.bad_bytes == len(other) and framer.unread == 1


def test_a_valid_message_after_random_bytes_is_decoded():
    random.seed(5)
    framer = Framer(Codec(2, 2))
    for _ in range(300):
        framer.datagram(random.randbytes(1000))
        framer.stream(random.randbytes(100))
    assert framer.bad_bytes > 300_000
    found = framer.stream(frames(1)[0] + bytes(300))
    assert numbers(found) == [0]


@given(st.text(max_size=160).filter(lambda t: "\x00" not in t))
def test_long_texts_are_joined(text):
    if not text.isascii():
        text = text.encode("ascii", "replace").decode()
    codec, assembler = Codec(1, 1), TextAssembler()
    whole = None
    for message in text_chunks(4, text, 3):
        found = Framer(codec).datagram(codec.encode(message))
        whole = assembler.add(found[0])
    assert whole == visible(text)


def test_lost_piece_of_a_text_gives_no_text():
    first, _, third = text_chunks(4, "x" * 120, 1)
    assembler = TextAssembler()
    assert assembler.add(first) is None
    assert assembler.add(third) is None


def test_clean_text():
    assert clean_text("AB\x00rubbish") == "AB"
    assert clean_text(b"AB\x00\xff") == "AB"
