"""What crashed flights left: locks, processes without their orchestrator."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

from uam_lab.doctor import holders
from uam_lab.doctor.finding import Finding, ok, warn
from uam_lab.processes import process_table
from uam_sim_bridge.ports import held


def checks(folder: Path | None = None) -> Iterator[Finding]:
    """Findings about leftovers; folder: where flights keep their locks."""
    yield locks(folder or Path(tempfile.gettempdir()))
    yield orphans()


def locks(folder: Path) -> Finding:
    """Lock files that nobody holds: harmless, the next flight takes them over."""
    name = re.compile(rf"uam-{os.getuid()}-\d+\.lock")
    ours = (file for file in sorted(folder.glob("uam-*.lock")) if name.fullmatch(file.name))
    left = [file for file in ours if not held(file)]
    if left:
        names = ", ".join(file.name for file in left)
        return warn(
            "locks",
            f"without a flight: {names} in {folder}",
            "nothing to do: the next flights use them again and remove them",
        )
    return ok("locks", f"none left in {folder}")


def orphans() -> Finding:
    """Nodes whose `uam fly` has gone; they end by themselves within seconds, as a rule."""
    left = [process.pid for process in process_table.orphans()]
    if left:
        return warn(
            "processes",
            ", ".join(map(holders.name_of, left)) + " without a flight",
            f"kill {' '.join(map(str, left))}",
        )
    return ok("processes", "no node without its flight")
