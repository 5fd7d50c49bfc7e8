"""A flight with the ROS engine of which only the outcome is kept."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from rich.console import Console

from uam_lab.flight.progress import Progress
from uam_lab.flight.settings import FlightSettings
from uam_lab.results.outcome import Outcome
from uam_lab.results.result_folder import ResultFolder


def fly(settings: FlightSettings) -> Outcome:
    """Fly as `uam fly` does; discard log and output of the nodes."""
    from uam_lab.flight.ros import engine as ros_engine

    with (
        tempfile.TemporaryDirectory(prefix="uam-flight-") as folder,
        open(os.devnull, "w") as nowhere,
        Progress(Console(file=nowhere)) as progress,
    ):
        return ros_engine.fly(settings, ResultFolder(Path(folder)), progress)
