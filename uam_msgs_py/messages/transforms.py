"""Poses of frames ↔ serialized tf2_msgs/TFMessage, for /tf and /tf_static."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uam_control.stamps import SECOND
from uam_msgs_py.messages.layouts import ENCAPSULATION, BadMessage, is_little_endian

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
    reader = _Reader(data)
    try:
        return [reader.transform() for _ in range(*reader.take("<I", 4))]
    except (struct.error, UnicodeDecodeError):
        raise BadMessage("not a list of transforms") from None


class _Reader:
    def __init__(self, data: bytes):
        self._data, self._at = data, ENCAPSULATION

    def take(self, form: str, alignment: int) -> tuple:
        """Return the next values; form: format of `struct`."""
        self._at += -(self._at - ENCAPSULATION) % alignment
        found = struct.unpack_from(form, self._data, self._at)
        self._at += struct.calcsize(form)
        return found

    def text(self) -> str:
        (length,) = self.take("<I", 4)
        (text,) = self.take(f"{length}s", 1)
        return text.rstrip(b"\0").decode()

    def transform(self) -> Transform:
        seconds, nanoseconds = self.take("<iI", 4)
        parent, child = self.text(), self.text()
        *position, x, y, z, w = self.take(f"<{NUMBERS}d", 8)
        stamp = seconds * SECOND + nanoseconds
        return Transform(stamp, parent, child, np.array(position), np.array([w, x, y, z]))


def _align(data: bytearray, size: int) -> None:
    """Pad to a multiple of `size`, counted from the end of the encapsulation."""
    data += bytes(-(len(data) - ENCAPSULATION) % size)
