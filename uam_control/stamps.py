"""Conversion between stamps, integer nanoseconds [ns], and times of the maths, seconds [s]."""

SECOND = 1_000_000_000  # [ns]
_MICROSECOND = 1_000  # [ns]
NEW_TIME = SECOND  # [ns] a stamp that goes back by more belongs to a new simulation, not to jitter


def nanoseconds(time: float) -> int:
    """Return the stamp [ns] of a time [s], rounded to a microsecond, the unit of sample times."""
    return round(time * 1e6) * _MICROSECOND
