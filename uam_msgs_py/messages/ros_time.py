"""Stamps: integer nanoseconds here, builtin_interfaces/Time in messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from uam_control.stamps import SECOND

if TYPE_CHECKING:
    from builtin_interfaces.msg import Time


def set_stamp(stamp: Time, nanoseconds: int) -> None:
    """Set `stamp` to integer nanoseconds, in place."""
    stamp.sec, stamp.nanosec = divmod(nanoseconds, SECOND)


def nanoseconds(stamp: Time) -> int:
    """Return a builtin_interfaces/Time in integer nanoseconds."""
    return stamp.sec * SECOND + stamp.nanosec
