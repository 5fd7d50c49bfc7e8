"""Byte positions of the numbers in a serialized message.

Messages of one topic with the same names have the same layout. The first message is parsed; later
ones are only compared with it in the bytes that are not numbers. This takes a fraction of the time
of ROS's message objects at 250 Hz in eight processes, and NumPy reads a log within a second.

Encoding: plain CDR, little-endian (the default of ROS 2). Numbers are aligned to their size,
counted from the end of the four bytes of encapsulation; a sequence is its length (uint32) followed
by its elements.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from uam_control.settings.texts import visible
from uam_control.stamps import SECOND

ENCAPSULATION = 4
STAMP = slice(4, 12)  # std_msgs/Header and rosgraph_msgs/Clock begin with it
KNOWN_LAYOUTS = 32  # stored per message type
MOST_NAMES = 1000  # of a message
LONGEST_TEXT = 300  # characters of what is wrong
_STAMP = {True: struct.Struct("<iI"), False: struct.Struct(">iI")}


class BadMessage(ValueError):
    """An invalid message; the text is one line: what is wrong, what is expected."""

    def __init__(self, text: str) -> None:
        """text: may contain parts of the message, of any length and with control characters."""
        line = visible(" ".join(text.split()))
        super().__init__(line if len(line) <= LONGEST_TEXT else f"{line[:LONGEST_TEXT]}...")


def is_little_endian(data: bytes) -> bool:
    """Return whether serialized `data` is little-endian: second byte of the encapsulation."""
    return data[1:2] == b"\x01"


def stamp_of(data: bytes, where: slice = STAMP) -> int:
    """Return a stamp [ns] of a serialized message, by default that of its header.

    Raises BadMessage if the message is too short.
    """
    if len(data) < where.stop:
        raise BadMessage(f"{len(data)} bytes, too short for a header")
    seconds, nanoseconds = _STAMP[is_little_endian(data)].unpack_from(data, where.start)
    return seconds * SECOND + nanoseconds


@dataclass
class Layout:
    """Layout of a message and of all messages that fit it."""

    frame: str = ""
    names: list[str] = field(default_factory=list)  # of the joints
    points: int = 0  # of a trajectory; `fields` are those of the first point
    fields: dict[str, slice] = field(default_factory=dict)  # name → bytes of float64 numbers
    duration: slice | None = None  # bytes of time_from_start
    end: int = 0  # first byte after the message, if it has at most one point
    checked: dict[object, Any] = field(default_factory=dict)  # reader → result of its check
    _fixed: struct.Struct = struct.Struct("")
    _expected: tuple[bytes, ...] = ()

    def length(self, name: str) -> int:
        """Return the number of values in a field, 0 if it is empty."""
        where = self.fields.get(name)
        return (where.stop - where.start) // 8 if where else 0

    def fits(self, data: bytes) -> bool:
        """Return whether `data` has this layout; data: of the same length."""
        return self._fixed.unpack_from(data) == self._expected

    def fix(self, data: bytes, ranges: list[tuple[int, int]]) -> None:
        """Store the bytes that define the layout: texts and lengths, not numbers and padding."""
        form, at = "<", 0
        for start, stop in ranges:
            form += f"{start - at}x{stop - start}s"
            at = stop
        self._fixed = struct.Struct(form)
        self._expected = self._fixed.unpack_from(data)


class Cursor:
    """Parses a message and stores its layout. Raises BadMessage if the message ends early."""

    def __init__(self, data: bytes):
        self.data, self.at = data, ENCAPSULATION
        self.layout = Layout()
        self.fixed = [(0, 2)]

    def forward(self, size: int, align: int) -> slice:
        """Skip padding and `size` bytes; return the slice of these bytes."""
        start = self.at + -(self.at - ENCAPSULATION) % align
        self.at = start + size
        if self.at > len(self.data):
            raise BadMessage(f"truncated after {len(self.data)} bytes")
        return slice(start, self.at)

    def count(self) -> int:
        """Read a uint32."""
        where = self.forward(4, align=4)
        self.fixed.append((where.start, where.stop))
        return int.from_bytes(self.data[where], "little")

    def string(self) -> str:
        """Read a string."""
        where = self.forward(self.count(), align=1)
        self.fixed.append((where.start, where.stop))
        return self.data[where].rstrip(b"\0").decode(errors="replace")

    def doubles(self, name: str, length: int | None = None) -> None:
        """Store the position of `length` float64; None: of a sequence."""
        if length is None:
            length = self.count()
        if length:
            self.layout.fields[name] = self.forward(8 * length, align=8)

    def stamp(self) -> slice:
        """Skip a stamp or duration; return the slice of its bytes."""
        return self.forward(8, align=4)

    def header(self) -> None:
        """Read a std_msgs/Header."""
        self.stamp()
        self.layout.frame = self.string()

    def names(self) -> None:
        """Read a sequence of strings, the names of the joints."""
        count = self.count()
        if count > MOST_NAMES:  # a million empty ones would take a second
            raise BadMessage(f"{count} names, at most {MOST_NAMES} allowed")
        self.layout.names = [self.string() for _ in range(count)]

    def first_point(self) -> None:
        """Read the number of points of a trajectory, and the first point."""
        self.layout.points = self.count()
        if self.layout.points:
            for name in ("positions", "velocities", "accelerations", "effort"):
                self.doubles(name)
            self.layout.duration = self.stamp()

    def no_dimensions(self) -> None:
        """Read the layout of an array; raises BadMessage for one with dimensions."""
        if self.count():
            raise BadMessage("a layout with dimensions; a plain array is expected")
        self.count()  # data_offset


# Content of each type: a step of the cursor, or a field of float64: its name, or (name, length).
CONTENT: dict[str, tuple[Callable[[Cursor], None] | str | tuple[str, int], ...]] = {
    "trajectory_msgs/msg/JointTrajectory": (Cursor.header, Cursor.names, Cursor.first_point),
    "sensor_msgs/msg/JointState": (Cursor.header, Cursor.names, "position", "velocity", "effort"),
    "sensor_msgs/msg/Imu": (
        Cursor.header,
        *(("orientation", 4), ("orientation_covariance", 9)),
        *(("angular_velocity", 3), ("angular_velocity_covariance", 9)),
        *(("linear_acceleration", 3), ("linear_acceleration_covariance", 9)),
    ),
    "geometry_msgs/msg/PoseStamped": (Cursor.header, ("position", 3), ("orientation", 4)),
    "geometry_msgs/msg/TwistStamped": (Cursor.header, ("linear", 3), ("angular", 3)),
    "std_msgs/msg/Float64MultiArray": (Cursor.no_dimensions, "data"),
    "rosgraph_msgs/msg/Clock": (Cursor.stamp,),
}


class Layouts:
    """The layouts of the received messages of one type."""

    def __init__(self, type_name: str):
        """type_name: one of CONTENT; raises KeyError for another."""
        self._content = CONTENT[type_name]
        self._known: dict[int, list[Layout]] = {}
        self._count = 0

    def of(self, data: bytes) -> Layout:
        """Return the layout of `data`, the same object for equal layouts.

        Raises BadMessage if it is not a message of this type.
        """
        for layout in self._known.get(len(data), ()):
            if layout.fits(data):
                return layout
        if not is_little_endian(data):
            raise BadMessage("not little-endian")
        cursor = Cursor(data)
        for part in self._content:
            if callable(part):
                part(cursor)
            else:
                cursor.doubles(*((part,) if isinstance(part, str) else part))
        layout = cursor.layout
        layout.end = cursor.at
        layout.fix(data, cursor.fixed)
        if self._count >= KNOWN_LAYOUTS:  # a sender with ever new names: bound the memory
            self._known.clear()
            self._count = 0
        self._known.setdefault(len(data), []).append(layout)
        self._count += 1
        return layout
