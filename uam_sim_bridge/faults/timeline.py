"""Which faults of a schedule are there at a moment, and when each came and went."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from uam_sim_bridge.faults.fault import Fault
from uam_sim_bridge.faults.schedule import Schedule, TimedFault

TOLERANCE = 1e-6  # [s] stamps are whole microseconds


@dataclass
class Happened:
    """What became of one fault; times are mission times [s], None: not yet."""

    planned: TimedFault
    number: int
    begin: float | None = None
    end: float | None = None

    @property
    def fault(self) -> Fault:
        """The fault itself."""
        return self.planned.fault

    @property
    def active(self) -> bool:
        """Whether it is there now."""
        return self.begin is not None and self.end is None

    @property
    def record(self) -> dict[str, Any]:
        """As metrics.json and info.json have it."""
        return record(self.fault.NAME, self.begin, self.end, self.fault.values)


def record(name: str, begin: float, end: float | None, values: dict[str, Any]) -> dict[str, Any]:
    """An entry of `faults` in metrics.json; end None: it was there until the flight ended."""
    over = None if end is None else round(end, 6)
    return {"fault": name, "begin_s": round(begin, 6), "end_s": over, "parameters": values}


class Timeline:
    """Steps through a schedule. Its time is counted from take-off by whoever calls it.

    The take-off is told once, as stamp and mission time of any status; from then on the clock of
    the stamps counts, so that a mission that stops its own time has no say in it.
    """

    def __init__(self, schedule: Schedule) -> None:
        self.all = [Happened(one, number) for number, one in enumerate(schedule.faults)]
        self._takeoff: float | None = None
        self._pending = bool(self.all)

    def mission_at(self, stamp: float, time: float) -> None:
        """At `stamp` [s] the mission's time was `time` [s], negative before take-off."""
        if self._takeoff is None and time >= 0.0:
            self._takeoff = stamp - time

    def time(self, stamp: float) -> float | None:
        """Mission time [s] at a stamp [s]; None before take-off."""
        return None if self._takeoff is None else stamp - self._takeoff

    def update(self, stamp: float) -> list[Happened]:
        """Switch to `stamp` [s]; returns what came or went with it."""
        if self._takeoff is None or not self._pending:
            return []
        now, changed = stamp - self._takeoff + TOLERANCE, []
        for one in self.all:
            end = one.planned.at + one.planned.duration
            if one.begin is None and now >= one.planned.at:
                one.begin = now - TOLERANCE
                changed.append(one)
            elif one.active and now >= end:
                one.end = now - TOLERANCE
                changed.append(one)
        self._pending = any(
            one.end is None and (one.begin is None or not math.isinf(one.planned.duration))
            for one in self.all
        )
        return changed

    @property
    def records(self) -> list[dict[str, Any]]:
        """What has happened so far, in the order of the schedule."""
        return [one.record for one in self.all if one.begin is not None]
