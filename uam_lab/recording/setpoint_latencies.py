"""Latency from the IMU's samples to their setpoints in the log of a rehearsal."""

from __future__ import annotations

import numpy as np

from uam_lab.recording.logged_topics import Log
from uam_msgs_py.messages import topics
from uam_sim_bridge.nodes.latencies import DEADLINE_TICKS


def latencies(log: Log, period: float) -> tuple[np.ndarray, int]:
    """Return the times (m,) [s] from the IMU's samples to the sending of their setpoints.

    And the number of missed ticks, sent later than DEADLINE_TICKS periods [s] or never. A tick has
    the stamp of its sample; stamps and wall times are those of the same computer.
    """
    stamps, sent = log.published(topics.SETPOINT)
    states, _ = log.published(topics.STATE)
    if not len(stamps):
        return np.zeros(0), len(states)
    latency = 1e-9 * (sent - stamps)
    within = states[(states >= stamps.min()) & (states <= stamps.max())]
    never = len(np.setdiff1d(within, stamps))
    return latency, int(np.sum(latency > DEADLINE_TICKS * period)) + never
