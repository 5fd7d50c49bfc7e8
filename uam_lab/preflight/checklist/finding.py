"""The result of one item of the checklist."""

from __future__ import annotations

from dataclasses import dataclass

UNKNOWN = "unknown"


@dataclass(frozen=True)
class Finding:
    """name: of the item; value and limit: texts with units.

    standing: the item is judged only while nobody moves the vehicle.
    """

    name: str
    value: str
    limit: str
    passed: bool
    standing: bool = False

    @property
    def text(self) -> str:
        """Return the finding in one line."""
        return f"{self.name}: {self.value} ({self.limit})"


def at_most(
    name: str, value: float | None, limit: float, unit: str, standing: bool = False
) -> Finding:
    """Return the finding of a value with an upper limit; None: it is not known, not passed."""
    passed = value is not None and value <= limit
    return Finding(name, _shown(value, unit), f"at most {_shown(limit, unit)}", passed, standing)


def at_least(name: str, value: float | None, limit: float, unit: str) -> Finding:
    """Return the finding of a value with a lower limit; None: it is not known, not passed."""
    passed = value is not None and value >= limit
    return Finding(name, _shown(value, unit), f"at least {_shown(limit, unit)}", passed)


def _shown(value: float | None, unit: str) -> str:
    return UNKNOWN if value is None else f"{value:.3g} {unit}".strip()
