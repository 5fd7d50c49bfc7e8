"""What a person runs: command line, flights, recordings, results, reports, campaigns.

    from uam_lab import Flight

See docs/extending.md.
"""

import importlib
import os
from importlib.util import find_spec
from typing import Any

# name → module; imported when it is used, because each node of a flight imports this package
OFFERED = {
    "Flight": "flight",
    "FlightResult": "flight_result",
    "FlightStatus": "flight",
    "Observer": "flight",
    "FlightError": "flight_result",
    "FlightFailed": "flight_result",
    "FlightEnded": "flight_result",
    "CommandRefused": "flight_result",
    "NotInTime": "flight_result",
}
__all__ = list(OFFERED)


backend = os.environ.get("MPLBACKEND", "")
if backend.startswith("module://") and find_spec(backend[9:].split(".")[0]) is None:
    del os.environ["MPLBACKEND"]  # of a notebook that runs in another Python: no figure without


def __getattr__(name: str) -> Any:
    if name not in OFFERED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.flights.library.{OFFERED[name]}"), name)
