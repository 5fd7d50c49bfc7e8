"""Fault injection in the direct engine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from uam_sim_bridge.faults.direct_link import DirectLink
from uam_sim_bridge.faults.fault import LINK, PLANT
from uam_sim_bridge.faults.faulty_plant import FaultyPlant
from uam_sim_bridge.faults.schedule import Schedule
from uam_sim_bridge.faults.timeline import Timeline
from uam_sim_bridge.plant import Plant, Vehicle


class DirectFaults:
    """Creates the plant and the link with their faults and passes them the mission time."""

    def __init__(self, schedule: Schedule) -> None:
        """schedule: checked by `limits.check`."""
        self._schedule = schedule
        self.link = DirectLink(schedule.only(LINK))
        self._timelines: list[Timeline] = [self.link.timeline]

    def plant(
        self, vehicle: Vehicle, payload_mass: float, seed: int, arm_start: Sequence[float]
    ) -> Plant:
        """Return the plant of this flight; arguments as in `Plant`."""
        acting = self._schedule.only(PLANT)
        if not acting:
            return Plant(vehicle, payload_mass, seed, arm_start)
        made = FaultyPlant(vehicle, payload_mass, seed, arm_start, acting)
        self._timelines.append(made.timeline)
        return made

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
