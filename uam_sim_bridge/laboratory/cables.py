"""Pulls the cables of a laboratory at their times, and plugs them in again."""

from uam_sim_bridge.faults.schedule import Schedule
from uam_sim_bridge.faults.timeline import FaultState, Timeline
from uam_sim_bridge.laboratory.laboratory import Laboratory


class Cables:
    """The faults of a rehearsal after its start; call `update` at each tick."""

    def __init__(self, laboratory: Laboratory, schedule: Schedule) -> None:
        """schedule: faults of cables; mistakes of the set-up are the laboratory's."""
        self._lab = laboratory
        self.timeline = Timeline(schedule)

    def update(self, stamp: float) -> list[FaultState]:
        """Advance to `stamp` [s], the plant's time; return the faults that began or ended."""
        changed = self.timeline.update(stamp)
        for one in changed:
            one.fault.pull(self._lab, one.active)
        for fault in self.timeline.active:
            fault.last(self._lab)
        return changed
