"""Poses of frames ↔ serialized tf2_msgs/TFMessage, for /tf and /tf_static."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uam_control.stamps import SECOND
from uam_msgs_py.messages.layouts import (
    ENCAPSULATION,
    BadMessage,
    Cursor,
    is_little_endian,
    stamp_of,
)

LITTLE_ENDIAN = b"\0\1\0\0"  # the encapsulation of plain CDR
NUMBERS = 7  # translation x y z, rotation x y z w


@dataclass(frozen=True)
class Transform:
    """Pose of frame `child` in frame `parent` at `stamp` [ns].

    position (3,) [m]; quaternion (4,) [w x y z], child → parent.
    """

    stamp: int
    parent: str
    child: str
    position: np.ndarray
    quaternion: np.ndarray


def transforms_message(transforms: Sequence[Transform]) -> bytes:
    """Return the serialized TFMessage of `transforms`."""
    data = bytearray(LITTLE_ENDIAN + struct.pack("<I", len(transforms)))
    for transform in transforms:
        _align(data, 4)
        data += struct.pack("<iI", *divmod(transform.stamp, SECOND))
        for name in (transform.parent, transform.child):
            _align(data, 4)
            text = name.encode() + b"\0"
            data += struct.pack("<I", len(text)) + text
        _align(data, 8)
        w, x, y, z = transform.quaternion
        data += struct.pack(f"<{NUMBERS}d", *transform.position, x, y, z, w)
    return bytes(data)


def read_transforms(data: bytes) -> list[Transform]:
    """Return the transforms of a serialized TFMessage; raises BadMessage for other data."""
    if not is_little_endian(data):
        raise BadMessage("transforms in the byte order of another machine")
    cursor = Cursor(data)
    return [_transform(cursor) for _ in range(cursor.count())]


def _transform(cursor: Cursor) -> Transform:
    stamp = stamp_of(cursor.data, cursor.stamp())
    parent, child = cursor.string(), cursor.string()
    numbers = np.frombuffer(cursor.data[cursor.forward(8 * NUMBERS, align=8)], "<f8")
    return Transform(stamp, parent, child, numbers[:3], np.roll(numbers[3:], 1))


def _align(data: bytearray, size: int) -> None:
    """Pad to a multiple of `size`, counted from the end of the encapsulation."""
    data += bytes(-(len(data) - ENCAPSULATION) % size)
