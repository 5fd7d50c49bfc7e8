"""What the log and the nodes tell beside a flight's table: latencies, losses, statistics."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from uam_control.stamps import SECOND
from uam_lab.records.recording.logged_topics import Log
from uam_msgs_py.messages import topics
from uam_sim_bridge.nodes.latencies import DEADLINE_TICKS

RECORDER = "recorder.json"
LABORATORY_FILE = "laboratory.json"


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


def statistics(file: Path) -> dict[str, Any]:
    """Return what a node wrote at its end, {} without it."""
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def losses(logs: Path) -> list[str]:
    """Return a note about the messages that the recorder lost, in a list; [] if it lost none."""
    lost = statistics(logs / RECORDER).get("lost")
    if not lost:
        return []
    text = ", ".join(f"{count} of {topic}" for topic, count in lost.items())
    buffers = "uam doctor checks the receive buffers"
    return [f"the recorder lost {sum(lost.values())} messages, {buffers}: {text}"]
