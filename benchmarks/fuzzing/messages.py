"""Input of the fuzzer: mutated frames of messages with extreme fields, and random bytes."""

from __future__ import annotations

import math
import random
import re
import struct
from collections import Counter

from uam_sim_bridge.autopilot.params import DEFINITIONS
from uam_sim_bridge.mavlink.protocol.wire import mavlink2

# Numbers and words that reach more code of the handlers than random ones.
FLOATS = (
    math.nan,
    math.inf,
    -math.inf,
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    1e-45,
    3.4e38,
    -3.4e38,
    1e10,
    6.0,
    21196.0,
    30.0,
    31.0,
    4000.0,
)
INTEGERS = (0, 1, 2, 3, 4, 6, 8, 16, 20, 21, 32, 63, 127, 128, 129, 176, 191, 255, 400, 511, 512)
WORDS = tuple(name.encode() for name in DEFINITIONS)
RANGES = {
    "b": (1, True),
    "B": (1, False),
    "h": (2, True),
    "H": (2, False),
    "i": (4, True),
    "I": (4, False),
    "q": (8, True),
    "Q": (8, False),
}
SPOKEN = {  # messages for which each target has a handler
    "bridge": (
        "HEARTBEAT",
        "COMMAND_ACK",
        "EXTENDED_SYS_STATE",
        "STATUSTEXT",
        "PARAM_VALUE",
        "TIMESYNC",
    ),
    "autopilot, UDP": (
        "SET_ATTITUDE_TARGET",
        "VISION_POSITION_ESTIMATE",
        "ODOMETRY",
        "COMMAND_LONG",
        "COMMAND_INT",
        "SET_MODE",
        "PARAM_REQUEST_READ",
        "PARAM_REQUEST_LIST",
        "PARAM_SET",
        "TIMESYNC",
    ),
    "autopilot, TCP": ("HIL_SENSOR", "VISION_POSITION_ESTIMATE", "ODOMETRY"),
    "plant": ("HIL_ACTUATOR_CONTROLS",),
}
KINDS = {kind.msgname: kind for kind in mavlink2.mavlink_map.values()}


def number(rng: random.Random) -> float:
    """Return an extreme or random number."""
    return (
        rng.choice(FLOATS)
        if rng.random() < 0.5
        else rng.gauss(0.0, 1.0) * 10.0 ** rng.randint(-300, 300)
    )


class Messages:
    """Mutated frames of messages with extreme fields, as datagrams or chunks of a stream."""

    def __init__(self, rng: random.Random, target: str, counts: Counter) -> None:
        self._rng, self._counts = rng, counts
        self._spoken = [KINDS[name] for name in SPOKEN[target]]
        self._all = list(KINDS.values())
        self._formats = {
            kind: re.findall(r"(\d*)([a-zA-Z])", kind.unpacker.format) for kind in self._all
        }
        self._sequence = 0
        self._last = b""
        self._late: list[bytes] = []

    def frame(self, checked: bool = True) -> bytes:
        """Return a complete frame of a message with extreme fields."""
        rng = self._rng
        kind = rng.choice(self._spoken if rng.random() < 0.85 else self._all)
        payload = b"".join(self._field(count, code) for count, code in self._formats[kind])
        self._sequence = (self._sequence + 1) % 256
        system = 1 if rng.random() < 0.9 else rng.randrange(256)
        component = rng.choice((0, 1, 191, 200, 255))
        if rng.random() < 0.1 and kind.id < 256:
            head = struct.pack("<BBBBB", len(payload), self._sequence, system, component, kind.id)
            marker = b"\xfe"
        else:
            payload = payload.rstrip(b"\0") or b"\0"
            number = kind.id.to_bytes(3, "little")
            head = (
                struct.pack("<BBBBBB", len(payload), 0, 0, self._sequence, system, component)
                + number
            )
            marker = b"\xfd"
        crc = mavlink2.x25crc(head + payload + bytes((kind.crc_extra,))).crc
        return marker + head + payload + struct.pack("<H", crc)

    def _field(self, count: str, code: str) -> bytes:
        rng = self._rng
        if code == "s":
            size = int(count or 1)
            word = rng.choice(WORDS) if rng.random() < 0.5 else rng.randbytes(rng.randint(0, size))
            return word[:size].ljust(size, b"\0")
        number = int(count or 1)
        if code in "fd":
            return b"".join(self._float(code) for _ in range(number))
        size, signed = RANGES.get(code, (1, False))
        return b"".join(self._integer(size, signed) for _ in range(number))

    def _float(self, code: str) -> bytes:
        rng = self._rng
        draw = rng.random()
        value = rng.gauss(0.0, 1.0) if draw < 0.6 else rng.choice(FLOATS)
        if draw > 0.9:
            return rng.randbytes(4 if code == "f" else 8)
        return struct.pack("<" + code, value)

    def _integer(self, size: int, signed: bool) -> bytes:
        rng = self._rng
        if rng.random() < 0.6:
            value = rng.choice(INTEGERS)
            return (value % (1 << 8 * size)).to_bytes(size, "little")
        return rng.randbytes(size)

    def chunk(self) -> tuple[bytes, int]:
        """Return a datagram or chunk and the number of its messages."""
        rng = self._rng
        frame = self.frame()
        draw = rng.random()
        if draw < 0.4:
            how = "whole"
        elif draw < 0.6:
            how, data = "bits flipped", bytearray(frame)
            for _ in range(rng.randint(1, 4)):
                data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            frame = bytes(data)
        elif draw < 0.7:
            how, frame = "truncated", frame[: rng.randrange(len(frame))]
        elif draw < 0.8:
            how, frame = "extended", frame + rng.randbytes(rng.randint(1, 40))
        elif draw < 0.88:
            how, frame = "repeated", frame + (self._last or frame)
        elif draw < 0.96:
            how = "reordered"
            self._late.append(frame)
            frame = self._late.pop(rng.randrange(len(self._late))) if len(self._late) > 3 else b""
        else:
            how, frame = "behind garbage", rng.randbytes(rng.randint(1, 60)) + frame
        self._counts[how] += 1
        self._last = frame[:300]
        return frame, 1


def garbage(rng: random.Random) -> bytes:
    """Return random bytes of the length of a datagram; some contain many start bytes of frames."""
    size = rng.choice((rng.randint(1, 60), rng.randint(1, 300), rng.randint(1, 1472), 1472))
    if rng.random() < 0.002:
        size = 65507
    data = rng.randbytes(size)
    if rng.random() < 0.2:
        data = data.replace(b"\x00", b"\xfd").replace(b"\x01", b"\xfe").replace(b"\x02", b"\x00")
    return data
