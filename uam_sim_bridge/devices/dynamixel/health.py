"""Health of the servos and of the bus, for /diagnostics."""

import math
from dataclasses import dataclass

# error → its bit of Hardware Error Status, and what to do
ERRORS = {
    "input voltage": (0, "supply outside the servo's limits: check battery and cable"),
    "overheating": (2, "let it cool, then reboot; reduce the load"),
    "encoder": (3, "the motor does not follow its encoder: replace the servo"),
    "electrical shock": (4, "circuit or supply too weak: check supply and cable, then reboot"),
    "overload": (5, "torque above the servo's ability for too long: remove the load, then reboot"),
}


def hardware_errors(status: int) -> list[str]:
    """Return the names of the errors in a Hardware Error Status."""
    known = [name for name, (bit, _) in ERRORS.items() if status & 1 << bit]
    rest = status & ~sum(1 << bit for bit, _ in ERRORS.values())
    return known + ([f"unknown error 0x{rest:02x}"] if rest else [])


def advice(status: int) -> str:
    """Return the errors with what to do, "" without one."""
    return "; ".join(
        f"{name} ({ERRORS[name][1]})" if name in ERRORS else name
        for name in hardware_errors(status)
    )


@dataclass
class ServoHealth:
    """What the driver last read of one servo, and counts since the start."""

    label: str
    joint: str
    temperature: float = math.nan  # [deg C]; NaN until read
    voltage: float = math.nan  # [V]; NaN until read
    error: int = 0  # Hardware Error Status
    torque_on: bool = False  # as last read
    misses: int = 0  # reads without an answer
    in_a_row: int = 0  # misses since the last answer
    lost: bool = False  # missed_reads in a row
    restarts: int = 0  # losses of torque without error
    trips: int = 0  # of the watchdog

    @property
    def problem(self) -> str:
        """The servo's problem in one line, "" without one."""
        if self.lost:
            return f"{self.label}: no answer to the last {self.in_a_row} reads: cable, supply, id?"
        return f"{self.label}: {advice(self.error)}" if self.error else ""


class CycleMeter:
    """Measures rate and duration of the cycles between two reports."""

    def __init__(self) -> None:
        self._first = self._last = math.nan
        self._cycles, self._busy, self._longest = 0, 0.0, 0.0

    def add(self, begun: float, ended: float) -> None:
        """Count a cycle from `begun` to `ended` [s]."""
        if math.isnan(self._first):
            self._first = begun
        self._last = begun
        self._cycles += 1
        self._busy += ended - begun
        self._longest = max(self._longest, ended - begun)

    def report(self) -> tuple[float, float, float]:
        """Return rate [Hz], mean and longest duration [s] since the last report; NaN: unknown."""
        if not self._cycles:
            return math.nan, math.nan, math.nan
        span = self._last - self._first
        rate = (self._cycles - 1) / span if span > 0.0 else math.nan
        found = rate, self._busy / self._cycles, self._longest
        self._first = self._last
        self._cycles, self._busy, self._longest = 1, found[1], 0.0
        return found
