"""Packets of a NatNet server, versions 3.0 to 4.1: server info, model definitions, frames.

Little-endian, without padding. Source: OptiTrack's NatNet documentation and its client in Python;
`natnet` and `motioncapture` read these packets in the tests. Written apart from the driver, so that
an error in one does not hide in the other.
"""

import struct
from collections.abc import Mapping, Sequence
from typing import NamedTuple

CONNECT, SERVER_INFO, REQUEST, RESPONSE = 0, 1, 2, 3
REQUEST_MODELS, MODELS, FRAME, KEEP_ALIVE, UNRECOGNIZED = 4, 5, 7, 10, 100
VERSIONS = ((3, 0), (3, 1), (4, 0), (4, 1))
FREQUENCY = 10_000_000  # [1/s] ticks of the server's clock, as on Windows
MARKERS = ((0.10, 0.02, 0.0), (-0.08, 0.02, 0.06), (0.0, 0.03, -0.09))  # [m] of every body
_TRACKED, _MODELS_CHANGED = 1, 2


class WireBody(NamedTuple):
    """A rigid body in a frame: position x y z [m], rotation x y z w, tracker's axes."""

    position: Sequence[float]
    rotation: Sequence[float]
    tracked: bool


class Stamps(NamedTuple):
    """Times [s] of the server's clock."""

    exposed: float
    received: float
    sent: float


def packet(message: int, content: bytes) -> bytes:
    return struct.pack("<HH", message, len(content)) + content


def server_info(version: tuple[int, int], data_port: int, multicast: bool, group: str) -> bytes:
    """Return the answer to CONNECT."""
    name = b"Emulated Motive"
    numbers = bytes([3, 1, 0, 0]), bytes([*version, 0, 0])
    address = bytes(map(int, group.split(".")))
    content = struct.pack(
        "<256s4s4sQH?4s", name, *numbers, FREQUENCY, data_port, multicast, address
    )
    return packet(SERVER_INFO, content)


def models(version: tuple[int, int], names: Mapping[int, str]) -> bytes:
    """Return the model definitions: for each body, id → name, its marker set and rigid body."""
    sets = []
    for number, name in names.items():
        text = name.encode() + b"\0"
        labels = [f"Marker{i + 1}\0".encode() for i in range(len(MARKERS))]
        sets.append((0, text + struct.pack("<I", len(labels)) + b"".join(labels)))
        body = text + struct.pack("<ii3f", number, -1, 0.0, 0.0, 0.0)
        body += struct.pack("<I", len(MARKERS))
        body += b"".join(struct.pack("<3f", *marker) for marker in MARKERS)
        body += struct.pack(f"<{len(MARKERS)}I", *[0] * len(MARKERS))
        if version >= (4, 0):
            body += b"".join(labels)
        sets.append((1, body))
    content = struct.pack("<I", len(sets))
    for kind, data in sets:
        content += struct.pack("<I", kind)
        if version >= (4, 1):
            content += struct.pack("<I", len(data))
        content += data
    return packet(MODELS, content)


def frame(
    version: tuple[int, int],
    number: int,
    stamps: Stamps,
    bodies: Mapping[int, WireBody],
    models_changed: bool,
) -> bytes:
    """Return a frame of data; bodies: id → body."""
    rigid = [
        struct.pack("<i3f4f", identity, *body.position, *body.rotation)
        + struct.pack("<fH", 0.0003, _TRACKED if body.tracked else 0)
        for identity, body in bodies.items()
    ]
    labeled = [
        struct.pack("<I3ffHf", identity << 16 | i + 1, *body.position, 0.014, 0x0A, 0.0002)
        for identity, body in bodies.items()
        if body.tracked
        for i in range(len(MARKERS))
    ]
    # marker sets, unlabeled markers, rigid bodies, skeletons, assets, labeled markers, plates ...
    parts = [[], [], rigid, [], *([[]] if version >= (4, 1) else []), labeled, [], []]
    content = struct.pack("<I", number)
    for part in parts:
        data = b"".join(part)
        content += struct.pack("<I", len(part))
        if version >= (4, 1):
            content += struct.pack("<I", len(data))
        content += data
    ticks = [round(time * FREQUENCY) for time in stamps]
    content += struct.pack("<IId3Q", 0, 0, stamps.exposed, *ticks)
    content += struct.pack("<H", _MODELS_CHANGED if models_changed else 0)
    return packet(FRAME, content + struct.pack("<I", 0))
