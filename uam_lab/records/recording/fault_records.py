"""Faults of a flight, read from its log."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from uam_control.stamps import SECOND
from uam_msgs_py.messages.fault_events import FaultEvent
from uam_sim_bridge.faults.timeline import record


def records(events: Iterable[tuple[int, FaultEvent]], takeoff: int) -> list[dict[str, Any]]:
    """Return the faults of a log, see `timeline.record`.

    events: with their stamps [ns]; takeoff: stamp [ns] of mission time 0.
    """
    found: dict[tuple[str, int], dict[str, Any]] = {}
    for stamp, event in events:
        time, key = (stamp - takeoff) / SECOND, (event.place, event.number)
        if event.active:
            found[key] = record(event.name, time, None, event.parameters)
        elif key in found:
            found[key]["end_s"] = round(time, 6)
    return sorted(found.values(), key=lambda entry: entry["begin_s"])
