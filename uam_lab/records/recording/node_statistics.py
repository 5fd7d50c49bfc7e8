"""What nodes write at their end, as JSON in the folder of the logs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

RECORDER = "recorder.json"
LABORATORY_FILE = "laboratory.json"


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
