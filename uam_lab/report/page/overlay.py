"""Overlay of several flights: common figures, and a page with them and the errors of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from uam_lab.records.results import metrics, templates
from uam_lab.records.results.atomic import write_text
from uam_lab.report.facts import paper
from uam_lab.report.figures import figures
from uam_lab.report.figures.panels import DrawnFlight
from uam_lab.report.page.figure_entries import figure_entries


def build_overlay(
    flights: Sequence[DrawnFlight], out: Path, progress: Callable[[str], None] = lambda text: None
) -> Path:
    """Write figures/ and report.html to `out`; return the page."""
    joints = max(flight.series.columns.joints for flight in flights)
    drawn = figures.draw(flights, out / "figures", progress)
    progress("page")
    text = templates.render(
        "uam_lab.report.page",
        "overlay.html.j2",
        labels=[flight.label for flight in flights],
        tables=[_table(flights, *table) for table in paper.tables(joints)],
        **figure_entries(out / "figures", drawn),
    )
    write_text(out / "report.html", text)
    return out / "report.html"


def labelled(directories: Sequence[Path]) -> list[str]:
    """Return a label per result folder: its name, or its whole path if two names are equal."""
    names = [directory.resolve().name for directory in directories]
    return [
        name if names.count(name) == 1 else str(directory)
        for name, directory in zip(names, directories, strict=True)
    ]


def _table(
    flights: Sequence[DrawnFlight],
    group: str,
    heading: str,
    unit: str,
    digits: int,
    names: Sequence[str],
) -> dict:
    """Return the RMS errors of one group of coordinates, one row per flight."""
    rows = []
    for flight in flights:
        found = metrics.errors(flight.series)[group]
        rows.append((flight.label, [f"{value:.{digits}f}" for value in found]))
    return {"heading": heading, "unit": unit, "names": names, "rows": rows}
