"""Stamps: integer nanoseconds here, builtin_interfaces/Time in messages, seconds in the maths."""

from __future__ import annotations

from typing import TYPE_CHECKING

from uam_msgs_py.messages.layouts import SECOND

if TYPE_CHECKING:
    from builtin_interfaces.msg import Time


def set_stamp(stamp: Time, nanoseconds: int) -> None:
    """Integer nanoseconds → builtin_interfaces/Time, in place."""
    stamp.sec, stamp.nanosec = divmod(nanoseconds, SECOND)


def nanoseconds(stamp: Time) -> int:
    """builtin_interfaces/Time → integer nanoseconds."""
    return stamp.sec * SECOND + stamp.nanosec


def seconds(nanoseconds: int) -> float:
    """Nanoseconds [ns] → the maths' seconds [s]."""
    return nanoseconds / SECOND
