"""Latency from the IMU's samples to their setpoints, in the log of a flight in real time."""

from __future__ import annotations

import numpy as np

from uam_control.stamps import SECOND
from uam_lab.records.recording.logged_topics import Log
from uam_msgs_py.messages import topics
from uam_sim_bridge.nodes.latencies import DEADLINE_TICKS


def latencies(log: Log, period: float, ticks: np.ndarray | None = None) -> tuple[np.ndarray, int]:
    """Return the times (m,) [s] from the IMU's samples to the sending of their setpoints.

    And the number of missed ticks, sent later than DEADLINE_TICKS periods [s] or never. ticks (k,)
    [ns]: those that count; None: those between the first and the last setpoint. A tick has the
    stamp of its sample; stamps and wall times are those of the same computer.
    """
    stamps, sent = log.published(topics.SETPOINT)
    if ticks is None:
        ticks, _ = log.published(topics.STATE)
        if len(stamps):
            ticks = ticks[(ticks >= stamps.min()) & (ticks <= stamps.max())]
    counts = np.isin(stamps, ticks)
    latency = (sent - stamps)[counts] / SECOND
    in_time = stamps[counts][latency <= DEADLINE_TICKS * period]
    return latency, len(np.setdiff1d(ticks, in_time))
