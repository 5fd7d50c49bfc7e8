"""Faults of the MAVLink connection in the direct engine, which skips the lost messages."""

from __future__ import annotations

import numpy as np

from uam_sim_bridge.faults.link_faults import MavlinkCorruption, MavlinkCut
from uam_sim_bridge.faults.schedule import Schedule
from uam_sim_bridge.faults.timeline import Timeline


class DirectLink:
    """Decides for each message whether it arrives.

    It covers cuts, and corruption of messages to the autopilot; `limits.needs_nodes` lists the
    faults that the direct engine refuses.
    """

    def __init__(self, schedule: Schedule) -> None:
        """schedule: faults of the link only."""
        self.timeline = Timeline(schedule)
        self._noise = np.random.default_rng(np.random.SeedSequence(schedule.seed, spawn_key=(1,)))

    def receives(self) -> bool:
        """Return whether messages from the autopilot arrive."""
        return not any(
            one.active and isinstance(one.fault, MavlinkCut) and one.fault.inwards
            for one in self.timeline.all
        )

    def passes(self) -> bool:
        """Return whether the next message to the autopilot arrives uncorrupted."""
        for one in self.timeline.all:
            if not one.active:
                continue
            if isinstance(one.fault, MavlinkCut):
                return False
            if isinstance(one.fault, MavlinkCorruption) and self._noise.random() < one.fault.share:
                return False
        return True
