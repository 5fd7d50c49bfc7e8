"""MAVLink 2 signing: accepted and refused packets."""

import pytest
from set_clock import SetClock

from uam_sim_bridge.mavlink.protocol.wire import EPOCH, Codec, Framer, Signing, mavlink2, wall_steps
from uam_sim_bridge.ports import PortError

KEY, OTHER = bytes(range(32)), bytes(32)
MINUTE = 6_000_000


def message(k=1):
    return mavlink2.MAVLink_timesync_message(k, 7)


def pair(sender_key=KEY, clock=None, **options):
    """Return a sender and the framer of a receiver that requires KEY."""
    clock = clock or SetClock(10 * MINUTE)
    sender = Codec(1, 1, Signing(sender_key, clock=clock, **options))
    return sender, Framer(Codec(2, 2, Signing(KEY, clock=clock)))


def refused(framer):
    return framer._codec.refused


def test_signed_passes_in_datagrams_and_streams():
    sender, framer = pair(link_id=3)
    frames = [sender.encode(message(k)) for k in range(1, 6)]
    assert all(len(f) == len(Codec(1, 1).encode(message())) + 13 and f[-13] == 3 for f in frames)
    found = [m.tc1 for f in frames[:2] for m in framer.datagram(f)]
    rest = b"".join(frames[2:])
    for i in range(0, len(rest), 5):
        found += [m.tc1 for m in framer.stream(rest[i : i + 5])]
    assert found == [1, 2, 3, 4, 5] and refused(framer) == 0 and framer.bad_bytes == 0


@pytest.mark.parametrize("sender", [Codec(1, 1), pair(OTHER)[0]], ids=["unsigned", "other key"])
def test_others_are_refused_and_counted(sender):
    _, framer = pair()
    assert framer.datagram(sender.encode(message()) * 2) == [] and refused(framer) == 2
    assert framer.stream(sender.encode(message())) == [] and refused(framer) == 3


def test_an_autopilot_without_signing_is_recognised():
    def beat(autopilot):
        return mavlink2.MAVLink_heartbeat_message(2, autopilot, 1, 0, 3, 3)

    codec = Codec(1, 191, Signing(KEY))
    framer = Framer(codec)
    assert framer.datagram(Codec(1, 1).encode(beat(mavlink2.MAV_AUTOPILOT_INVALID))) == []
    assert framer.datagram(Codec(1, 1, Signing(KEY)).encode(beat(12))) != []
    assert codec.unsigned is None
    assert framer.datagram(Codec(1, 1).encode(beat(mavlink2.MAV_AUTOPILOT_PX4))) == []
    assert codec.unsigned == mavlink2.MAV_AUTOPILOT_PX4


def test_mavlink_1_cannot_be_signed_and_is_refused():
    _, framer = pair()
    mav = mavlink2.MAVLink(None, 1, 1)
    assert framer.datagram(message().pack(mav, force_mavlink1=True)) == [] and refused(framer) == 1


def test_replay_is_refused_also_of_an_older_packet():
    sender, framer = pair()
    first, second = sender.encode(message(1)), sender.encode(message(2))
    assert len(framer.datagram(first + second)) == 2
    assert framer.datagram(second) == framer.datagram(first) == []
    assert refused(framer) == 2


def test_the_first_packet_of_a_sender_may_be_a_minute_old():
    clock = SetClock(10 * MINUTE)
    old = Codec(1, 1, Signing(KEY, clock=clock))
    early = [old.encode(message()) for _ in range(2)]
    for late, passes in ((MINUTE - 10, 1), (MINUTE + 10, 0)):
        _, framer = pair(clock=SetClock(clock.now + late))
        assert len(framer.datagram(early[0])) == passes


def test_one_flipped_bit_of_the_signature_is_refused():
    sender, framer = pair()
    frame = bytearray(sender.encode(message()))
    frame[-1] ^= 1
    assert framer.datagram(bytes(frame)) == [] and refused(framer) == 1


def test_a_forged_packet_from_the_future_does_not_lock_out_its_sender():
    sender, framer = pair()
    assert len(framer.datagram(sender.encode(message()))) == 1
    forger, _ = pair(OTHER, SetClock(1000 * MINUTE))
    assert framer.datagram(forger.encode(message())) == []
    assert len(framer.datagram(sender.encode(message()))) == 1 and refused(framer) == 1


def test_time_grows_with_every_packet_and_never_goes_back():
    clock = SetClock(10 * MINUTE)
    sender, framer = pair(clock=clock)

    def stamp():
        frame = sender.encode(message())
        assert len(framer.datagram(frame)) == 1
        return int.from_bytes(frame[-12:-6], "little")

    stamps = [stamp(), stamp()]
    clock.now -= MINUTE  # the wall clock is set back
    stamps += [stamp(), stamp()]
    clock.now += 2 * MINUTE
    stamps += [stamp()]
    assert stamps == sorted(set(stamps)) and stamps[-1] == clock.now


def test_wall_time_counts_from_2015():
    assert EPOCH == 1420070400 and 3.6e13 < wall_steps() < 2**48


def test_without_a_key_signed_packets_are_read_unchecked():
    sender, _ = pair()
    assert len(Framer(Codec(2, 2)).datagram(sender.encode(message()))) == 1


@pytest.mark.parametrize("end", ["", "\n", "  \r\n"])
def test_key_from_text_and_from_a_file(tmp_path, end):
    file = tmp_path / "key"
    file.write_text(KEY.hex().upper() + end)
    for text in (KEY.hex(), str(file)):
        signing = Signing.from_text(text, 5)
        assert signing.key == KEY and signing.link_id == 5
        assert KEY.hex() not in repr(signing) and repr(KEY) not in repr(signing)
    assert Signing.from_text("") is None


def test_a_bad_key_is_refused_without_repeating_it(tmp_path):
    file = tmp_path / "key"
    file.write_bytes(b"\xff" * 64)
    short = tmp_path / "short"
    short.write_text("abcd")
    for text in (
        KEY.hex()[:-1],
        KEY.hex() + "0",
        "x" * 5000,
        "\x00",
        str(file),
        str(short),
        str(tmp_path),
    ):
        with pytest.raises(PortError, match="signing key") as error:
            Signing.from_text(text)
        assert text not in str(error.value) and "\n" not in str(error.value)
