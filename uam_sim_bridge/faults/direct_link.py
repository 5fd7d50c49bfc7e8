"""Faults of the MAVLink connection where there is none: the direct engine skips what is lost."""

from __future__ import annotations

import numpy as np

from uam_sim_bridge.faults.link_faults import MavlinkCorruption, MavlinkCut
from uam_sim_bridge.faults.schedule import Schedule
from uam_sim_bridge.faults.timeline import Timeline


class DirectLink:
    """Says of each message to the autopilot whether it gets through.

    Of cuts and corruption it knows the way to the autopilot; see `limits.needs_nodes` for the rest.
    """

    def __init__(self, schedule: Schedule) -> None:
        """schedule: faults of the link alone."""
        self.timeline = Timeline(schedule)
        self._noise = np.random.default_rng(np.random.SeedSequence(schedule.seed, spawn_key=(1,)))

    def hears(self) -> bool:
        """Whether what the autopilot says arrives."""
        return not any(
            one.active and isinstance(one.fault, MavlinkCut) and one.fault.inwards
            for one in self.timeline.all
        )

    def passes(self) -> bool:
        """Whether the message that is being sent arrives in good order."""
        for one in self.timeline.all:
            if not one.active:
                continue
            if isinstance(one.fault, MavlinkCut):
                return False
            if isinstance(one.fault, MavlinkCorruption) and self._noise.random() < one.fault.share:
                return False
        return True
