"""The emulated serial cable: its timing as arithmetic, its ends as real pseudo-terminals."""

import os
import time
from contextlib import closing

import numpy as np
import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from uam_sim_bridge.devices.serial.serial_cable import SerialCable, Wire, disturbed

BAUD = 921600
PATIENCE = 30.0  # [s]


@given(
    st.lists(
        st.tuples(st.floats(0.0, 0.1), st.binary(min_size=1, max_size=300)), min_size=1, max_size=20
    ),
    st.sampled_from([9600, 57600, BAUD]),
)
def test_bytes_arrive_in_order_and_not_faster_than_the_line(chunks, baud):
    wire, now, sent, arrived = Wire(baud), 0.0, b"", b""
    for pause, data in chunks:
        now += pause
        wire.put(data, now)
        sent += data
        arrived += wire.take(now)
        # what has arrived by now had time on the line since the first byte
        assert len(arrived) * 10 / baud <= now - chunks[0][0] + 1e-9
        assert len(arrived) + wire.held == len(sent)
    while wire.due is not None:
        arrived += wire.take(wire.due)
    assert arrived == sent and wire.held == 0


def test_a_chunk_of_a_hundred_bytes_takes_its_time():
    wire = Wire(57600)
    wire.put(bytes(100), 2.0)
    assert wire.due == pytest.approx(2.0 + 1000 / 57600)  # ten bits a byte
    assert wire.take(2.017) == b"" and wire.take(2.01737) == bytes(100)
    wire.put(bytes(100), 3.0)
    wire.clear()
    assert wire.due is None and wire.held == 0


@given(st.binary(max_size=200), st.integers(0, 1000))
def test_without_errors_bytes_stay_and_with_certain_errors_all_bits_turn(data, seed):
    noise = np.random.default_rng(seed)
    assert disturbed(data, 0.0, noise) == data
    assert disturbed(data, 1.0, noise) == bytes(byte ^ 0xFF for byte in data)


def test_the_rate_of_bit_errors():
    noise, data = np.random.default_rng(3), bytes(100_000)
    wrong = np.unpackbits(np.frombuffer(disturbed(data, 1e-3, noise), np.uint8)).sum()
    assert 700 < wrong < 900  # 800 of 800,000 bits


@pytest.fixture
def cable(tmp_path):
    with closing(SerialCable(tmp_path / "ttyNEAR", tmp_path / "ttyFAR", BAUD)) as made:
        yield made


def opened(path):
    return serial.Serial(str(path), BAUD, timeout=0, exclusive=True)


def received(port, count):
    """Return `count` bytes of a port, or those that come within PATIENCE."""
    data, end = b"", time.monotonic() + PATIENCE
    while len(data) < count and time.monotonic() < end:
        data += port.read(4096)
        time.sleep(0.001)
    return data


def test_both_directions(cable):
    with opened(cable.near) as near, opened(cable.far) as far:
        near.write(b"to the autopilot")
        far.write(bytes(range(256)))
        assert received(far, 16) == b"to the autopilot"
        assert received(near, 256) == bytes(range(256))
    assert cable.carried == [16, 256]


def test_a_cut_cable_is_silent_and_an_unplugged_one_has_no_device(cable):
    with opened(cable.near) as near, opened(cable.far) as far:
        cable.cut = True
        near.write(b"lost")
        end = time.monotonic() + PATIENCE
        while cable.carried[0] < 4 and time.monotonic() < end:
            time.sleep(0.001)
        cable.cut = False
        near.write(b"heard")
        assert received(far, 5) == b"heard"
        cable.unplug()
        assert not cable.near.exists() and cable.far.exists()
        with pytest.raises(OSError):
            os.read(near.fileno(), 1)
            raise OSError  # an unplugged device returns no bytes, or an error
    cable.plug_in()
    with opened(cable.near) as near, opened(cable.far) as far:
        far.write(b"again")
        assert received(near, 5) == b"again"


def test_bit_errors_arrive(cable):
    cable.bit_error_rate = 1.0
    with opened(cable.near) as near, opened(cable.far) as far:
        near.write(b"\x00\xff")
        assert received(far, 2) == b"\xff\x00"


def test_nothing_stays_behind(tmp_path):
    made = SerialCable(tmp_path / "a", tmp_path / "b", BAUD)
    made.close()
    assert list(tmp_path.iterdir()) == []
