"""Serialized messages, written and read in place.

A Template serializes its message once; later it only replaces numbers and stamp in the bytes, which
are then published. A received message consists of its bytes and their layout. Stamps are integer
nanoseconds.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from uam_control.stamps import SECOND
from uam_msgs_py.messages.layouts import (
    STAMP,
    BadMessage,
    Layout,
    Layouts,
    is_little_endian,
    stamp_of,
)


def type_name(message_type: type) -> str:
    """Return `package/msg/Name` of a generated message class."""
    return f"{message_type.__module__.split('.')[0]}/msg/{message_type.__name__}"


MOST_BYTES = 1_000_000  # of a message that is deserialized: these take a third of a second
KINDS = (JointTrajectory, JointState, Imu, PoseStamped, TwistStamped, Float64MultiArray, Clock)
LAYOUTS = {kind: Layouts(type_name(kind)) for kind in KINDS}


def stays_serialized(message_type: type) -> bool:
    """Return whether messages of this type are read and written in serialized form."""
    return message_type in LAYOUTS


def stays_stamped(message_type: type) -> bool:
    """Return whether `stamp_of` reads the header of a serialized message of this type."""
    return message_type in LAYOUTS and message_type not in (Float64MultiArray, Clock)


class Template:
    """A serialized message to publish; `values`: field name → writable view (n,) of its numbers."""

    def __init__(self, message: Any, frame: str = ""):
        """message: of a type in LAYOUTS, with all names and with arrays of the final lengths.

        frame: of its header; "" for the message's own.
        """
        if frame:
            message.header.frame_id = frame
        data = serialize_message(message)
        layout = LAYOUTS[type(message)].of(data)
        # rclpy adds undefined bytes after empty sequences; strict readers refuse such a message
        data = data[: layout.end]
        # CDR aligns numbers from the end of the encapsulation: align this byte in memory
        self._bytes = np.zeros(4 + len(data), dtype=np.uint8)[4:]
        self._bytes[:] = np.frombuffer(data, dtype=np.uint8)
        self.values = {
            name: self._bytes[where].view("<f8") for name, where in layout.fields.items()
        }
        self._stamp = self._time(STAMP)
        self._duration = None if layout.duration is None else self._time(layout.duration)

    def _time(self, where: slice) -> np.ndarray:
        return self._bytes[where].view("<i4")  # seconds; nanoseconds fit an int32 as well

    def stamped(self, stamp: int, time_from_start: int = 0) -> bytes:
        """Return the message with this stamp [ns]; time_from_start [ns]: only of trajectories."""
        self._stamp[:] = divmod(stamp, SECOND)
        if self._duration is not None:
            self._duration[:] = divmod(time_from_start, SECOND)
        return self._bytes.tobytes()

    def plain(self) -> bytes:
        """Return the message, for types without a stamp."""
        return self._bytes.tobytes()


class Serialized:
    """A received message: its bytes and their layout."""

    def __init__(self, kind: type, data: bytes):
        """kind: a type in LAYOUTS. Raises BadMessage."""
        if not is_little_endian(data):
            data = serialize_message(deserialized(data, kind))
        self.data = data
        self.layout: Layout = LAYOUTS[kind].of(data)

    @property
    def stamp(self) -> int:
        """Return the stamp [ns]."""
        return stamp_of(self.data)

    def numbers(self, field: str) -> np.ndarray:
        """Return a read-only view (n,) of a field of numbers, (0,) if it is empty."""
        length = self.layout.length(field)
        if not length:
            return _NOTHING
        return np.frombuffer(self.data, "<f8", length, self.layout.fields[field].start)

    def vector(self, field: str) -> np.ndarray:
        """Return a copy (3,) of a vector's numbers; raises BadMessage unless all are finite."""
        values = self.numbers(field).copy()
        refuse_infinite(field, values, "xyz")
        return values


_NOTHING = np.zeros(0)


def all_finite(values: np.ndarray) -> bool:
    """Return whether no number is infinite or NaN, and their sum does not overflow.

    For so few numbers Python's sum takes half the time of NumPy's.
    """
    return math.isfinite(sum(values.ravel().tolist()))


def deserialized(data: bytes, kind: type) -> Any:
    """Return the message of type `kind`; raises BadMessage for bytes that are none, or too many."""
    if len(data) > MOST_BYTES:
        raise BadMessage(f"{len(data)} bytes, at most {MOST_BYTES} allowed")
    try:
        return deserialize_message(data, kind)
    except Exception:  # rclpy raises its own classes, without a common base
        raise BadMessage(f"cannot be deserialized: {len(data)} bytes, no {kind.__name__}") from None


def check_names(given: Sequence[str], expected: Sequence[str]) -> None:
    """Raise BadMessage unless `given` are exactly the expected joint names, in order."""
    if list(given) != list(expected):
        raise BadMessage(
            f"joint names {', '.join(given) or '(none)'}; expected {', '.join(expected)}"
        )


def check_length(what: str, length: int, names: Sequence[str]) -> None:
    """Raise BadMessage unless `length` equals the number of `names`; what: text for the error."""
    if length != len(names):
        raise BadMessage(f"{length} {what}, {len(names)} expected ({', '.join(names)})")


def refuse_infinite(what: str, values: np.ndarray, names: Sequence[str]) -> None:
    """Raise BadMessage unless all values (n,) of the coordinates `names` (n) are finite."""
    if not all_finite(values):
        for name, value in zip(names, values, strict=True):
            if not math.isfinite(value):
                raise BadMessage(f"{what} of {name} is {value}, not finite")
        raise BadMessage(f"the sum of {what} is not finite")
