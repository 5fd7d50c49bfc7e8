"""What a person runs: command line, flights, recordings, results, reports, campaigns.

    from uam_lab import Flight

See docs/library.md.
"""

from __future__ import annotations

import importlib
from typing import Any

# name → module; imported when it is used, because each node of a flight imports this package
OFFERED = {
    "Flight": "flight",
    "FlightResult": "flight_result",
    "FlightStatus": "flight",
    "Observer": "flight",
    "FlightError": "errors",
    "FlightFailed": "flight_result",
    "FlightEnded": "errors",
    "CommandRefused": "errors",
    "NotInTime": "errors",
}
__all__ = list(OFFERED)


def __getattr__(name: str) -> Any:
    """Return an offered name."""
    if name not in OFFERED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.library.{OFFERED[name]}"), name)
