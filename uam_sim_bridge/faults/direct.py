"""Fault injection in the direct engine."""

from __future__ import annotations

from typing import Any

from uam_sim_bridge.faults.direct_link import DirectLink
from uam_sim_bridge.faults.fault import LINK
from uam_sim_bridge.faults.faulty_plant import FaultyPlant
from uam_sim_bridge.faults.schedule import Schedule
from uam_sim_bridge.faults.timeline import Timeline
from uam_sim_bridge.plant import Plant


class DirectFaults:
    """Creates the link with its faults and passes plant and link the mission time."""

    def __init__(self, schedule: Schedule, plant: Plant) -> None:
        """schedule: checked by `limits.check`; plant: made with it."""
        self.link = DirectLink(schedule.only(LINK))
        self._timelines: list[Timeline] = [self.link.timeline]
        if isinstance(plant, FaultyPlant):
            self._timelines.append(plant.timeline)

    def update(self, stamp: float, time: float) -> None:
        """Set the mission time `time` [s] of the control tick at `stamp` [s]."""
        for timeline in self._timelines:
            timeline.mission_at(stamp, time)
        self.link.timeline.update(stamp)

    @property
    def records(self) -> list[dict[str, Any]]:
        """Return the records of all faults that have begun, in order of time."""
        found = [record for timeline in self._timelines for record in timeline.records]
        return sorted(found, key=lambda record: record["begin_s"])
