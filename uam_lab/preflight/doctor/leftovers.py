"""Checks for leftovers of crashed flights: locks, and processes without their parent."""

import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

from uam_lab.flights.processes import process_table
from uam_lab.preflight.doctor.finding import Finding, ok, warn
from uam_sim_bridge.ports import held


def checks(folder: Path | None = None) -> Iterator[Finding]:
    """Yield the findings about leftovers; folder: of the lock files of flights."""
    yield locks(folder or Path(tempfile.gettempdir()))
    yield orphans()


def locks(folder: Path) -> Finding:
    """Check for lock files without a process: harmless, the next flight uses them."""
    name = re.compile(rf"uam-{os.getuid()}-\d+\.lock")
    ours = (file for file in sorted(folder.glob("uam-*.lock")) if name.fullmatch(file.name))
    left = [file for file in ours if not held(file)]
    if left:
        names = ", ".join(file.name for file in left)
        return warn(
            "locks",
            f"without a flight: {names} in {folder}",
            "no action needed: the next flights use and remove them",
        )
    return ok("locks", f"none left in {folder}")


def orphans() -> Finding:
    """Check for nodes whose `uam fly` has ended; normally they end within seconds."""
    left = [process.pid for process in process_table.orphans()]
    if left:
        return warn(
            "processes",
            ", ".join(map(process_table.name_of, left)) + " without a flight",
            f"kill {' '.join(map(str, left))}",
        )
    return ok("processes", "no node without its flight")
