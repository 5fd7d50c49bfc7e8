"""Fault injection in the direct engine, which skips the messages that a fault of the link loses."""

from __future__ import annotations

from typing import Any

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.stages.step import DONE, Step
from uam_sim_bridge.faults.fault import LINK
from uam_sim_bridge.faults.faulty_plant import FaultyPlant
from uam_sim_bridge.faults.link_faults import LinkFault, MavlinkCorruption, MavlinkCut, MavlinkDelay
from uam_sim_bridge.faults.schedule import Schedule
from uam_sim_bridge.faults.timeline import Timeline
from uam_sim_bridge.plant import Plant


class DirectLink:
    """Decides for each message whether and how late it arrives.

    It covers cuts, delays, and corruption of messages to the autopilot; `feasibility.needs_nodes`
    lists the faults that the direct engine refuses.
    """

    def __init__(self, schedule: Schedule) -> None:
        """schedule: faults of the link only."""
        self.timeline = Timeline(schedule)
        self._noise = np.random.default_rng(np.random.SeedSequence(schedule.seed, spawn_key=(1,)))

    def receives(self) -> bool:
        """Return whether messages from the autopilot arrive."""
        return not any(fault.inwards and isinstance(fault, MavlinkCut) for fault in self._active)

    def passes(self) -> bool:
        """Return whether the next message to the autopilot arrives uncorrupted."""
        return not any(self._loses(fault) for fault in self._active)

    def late_to(self) -> float:
        """Return the delay [s] of the next message to the autopilot."""
        return self._late([fault for fault in self._active if fault.outwards])

    def late_from(self) -> float:
        """Return the delay [s] of the next message from the autopilot."""
        return self._late([fault for fault in self._active if fault.inwards])

    def _late(self, faults: list[LinkFault]) -> float:
        late = [fault.late(self._noise) for fault in faults if isinstance(fault, MavlinkDelay)]
        return sum(late)

    def _loses(self, fault: LinkFault) -> bool:
        if isinstance(fault, MavlinkCorruption):
            return self._noise.random() < fault.share
        return isinstance(fault, MavlinkCut)

    @property
    def _active(self) -> list[LinkFault]:
        return [one.fault for one in self.timeline.all if one.active]


class DirectFaults:
    """Creates the link with its faults and passes plant and link the mission time."""

    def __init__(self, schedule: Schedule, plant: Plant) -> None:
        """schedule: checked by `feasibility.check`; plant: made with it."""
        self.link = DirectLink(schedule.only(LINK))
        self._timelines: list[Timeline] = [self.link.timeline]
        if isinstance(plant, FaultyPlant):
            self._timelines.append(plant.timeline)

    def step(self, tick: object) -> Step | None:
        """Return the compiled step of a tick that sets no time; None with faults of the link."""
        return None if self.link.timeline.all else Step(unchanged, ())

    def update(self, stamp: float, time: float, phase: str) -> None:
        """Set mission time [s] and phase of the control tick at `stamp` [s]."""
        for timeline in self._timelines:
            timeline.mission_at(stamp, time, phase)
        self.link.timeline.update(stamp)

    @property
    def records(self) -> list[dict[str, Any]]:
        """Return the records of all faults that have begun, in order of time."""
        found = [record for timeline in self._timelines for record in timeline.records]
        return sorted(found, key=lambda record: record["begin_s"])


@borrowing
def unchanged(arrays: tuple) -> int:
    """Do nothing: mission time and phase are as the stamp tells until the objects change them."""
    return DONE
