"""Begin and end of the faults of a schedule, tick by tick."""

import math
from dataclasses import dataclass
from typing import Any

from uam_sim_bridge.faults.fault import Fault
from uam_sim_bridge.faults.schedule import FROM_START, Schedule, TimedFault

TOLERANCE = 1e-6  # s; stamps are whole microseconds


@dataclass
class FaultState:
    """State of a fault in a flight."""

    planned: TimedFault
    number: int
    begin: float | None = None  # [s] mission time, 0 for one from the start; None: not yet
    end: float | None = None  # [s] mission time; None: not yet

    @property
    def fault(self) -> Fault:
        return self.planned.fault

    @property
    def active(self) -> bool:
        """Return whether the fault has begun and not ended."""
        return self.begin is not None and self.end is None

    @property
    def record(self) -> dict[str, Any]:
        """Return the entry of `faults` in metrics.json and info.json."""
        return record(self.fault.NAME, self.begin, self.end, self.fault.to_mapping())


def record(name: str, begin: float, end: float | None, values: dict[str, Any]) -> dict[str, Any]:
    """Return an entry of `faults` in metrics.json; end None: active at the end of the flight."""
    over = None if end is None else round(end, 6)
    return {"fault": name, "begin_s": round(begin, 6), "end_s": over, "parameters": values}


class PhaseTimes:
    """Mission times at which the phases of a flight began; with them the begin of each fault."""

    def __init__(self) -> None:
        self._begun: dict[str, float] = {}

    def at(self, phase: str, time: float) -> None:
        """Say that the flight is in `phase` at mission time `time` [s]."""
        self._begun.setdefault(phase, time)

    def begin(self, planned: TimedFault) -> float:
        """Return the mission time [s] at which a fault begins; inf: its phase has not begun."""
        if not planned.phase:
            return planned.at
        return self._begun.get(planned.phase, math.inf) + planned.at


class Timeline:
    """Begins and ends the faults of a schedule at their mission times.

    The first mission status after take-off fixes the stamp of take-off, and the first one of a
    phase its begin. Between them only the stamps count: a hold does not delay a fault.
    """

    def __init__(self, schedule: Schedule) -> None:
        self.all = [FaultState(one, number) for number, one in enumerate(schedule.faults)]
        self._takeoff: float | None = None
        self._phases = PhaseTimes()
        self._pending = bool(self.all)
        self._at_start = any(one.planned.at == FROM_START for one in self.all)

    def mission_at(self, stamp: float, time: float, phase: str) -> None:
        """Set mission time [s] and phase at `stamp` [s]; the time is negative before take-off."""
        if time < 0.0:
            return
        if self._takeoff is None:
            self._takeoff = stamp - time
        self._phases.at(phase, stamp - self._takeoff)

    def time(self, stamp: float) -> float | None:
        """Return the mission time [s] at `stamp` [s]; None before take-off."""
        return None if self._takeoff is None else stamp - self._takeoff

    def update(self, stamp: float) -> list[FaultState]:
        """Advance to `stamp` [s]; return the faults that began or ended."""
        if not self._pending or (self._takeoff is None and not self._at_start):
            return []
        now = FROM_START if self._takeoff is None else stamp - self._takeoff + TOLERANCE
        self._at_start, changed = False, []
        for one in self.all:
            begin = self._phases.begin(one.planned)
            end = begin + one.planned.duration
            if one.begin is None and now >= begin:
                one.begin = max(now - TOLERANCE, 0.0)
                changed.append(one)
            elif one.active and now >= end:
                one.end = now - TOLERANCE
                changed.append(one)
        self._pending = any(
            one.end is None and (one.begin is None or not math.isinf(one.planned.duration))
            for one in self.all
        )
        return changed

    def unchanged_for(self, stamp: float) -> float:
        """Return how long from `stamp` [s] on `update` changes nothing, if no phase begins [s]."""
        if not self._pending:
            return math.inf
        if self._takeoff is None:
            return 0.0
        begins = ((one, self._phases.begin(one.planned)) for one in self.all if one.end is None)
        times = (begin + (one.planned.duration if one.active else 0.0) for one, begin in begins)
        return max(0.0, self._takeoff + min(times) - TOLERANCE - stamp)

    @property
    def active(self) -> list[Any]:
        """Return the faults that have begun and not ended, in the order of the schedule."""
        return [one.fault for one in self.all if one.active]

    @property
    def records(self) -> list[dict[str, Any]]:
        """Return the records of all faults that have begun, in the order of the schedule."""
        return [one.record for one in self.all if one.begin is not None]
