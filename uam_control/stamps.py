"""Stamps are integer nanoseconds [ns]; the maths takes seconds [s]."""

from __future__ import annotations

SECOND = 1_000_000_000  # [ns]
_MICROSECOND = 1_000  # [ns]


def seconds(stamp: int) -> float:
    """Return the seconds [s] of a stamp [ns]."""
    return stamp / SECOND


def nanoseconds(time: float) -> int:
    """Return the stamp [ns] of a time [s], to the microsecond: sample times are whole ones."""
    return round(time * 1e6) * _MICROSECOND
