"""report.html: one page about the whole flight; it loads nothing from the network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from uam_control.laws import catalogue
from uam_lab.records.results import templates
from uam_lab.records.results.atomic import write_text
from uam_lab.records.results.result_folder import PX4_LOG, read_json
from uam_lab.report.facts import change_rows, flight_summary, stability_rows
from uam_lab.report.facts import parameter_table as parameters
from uam_lab.report.figures import fault_marks
from uam_lab.report.figures.figures import FIGURES
from uam_lab.report.page.figure_entries import figure_entries
from uam_lab.report.video.flight_video import Rendered, existing

FACTS = (
    ("controller", "controller"),
    ("profile", "profile"),
    ("scenario", "scenario"),
    ("engine", "engine"),
    ("layout", "layout"),
    ("clock", "clock"),
    ("autopilot", "autopilot"),
    ("seed", "seed"),
    ("payload_mass_kg", "payload mass [kg]"),
)

FILES = (
    ("log.mcap", "the log of all topics, a bag of ROS 2"),
    (PX4_LOG, "the log of PX4"),
    ("timeseries.parquet", "one row per control tick"),
    ("metrics.json", "the numbers of this page"),
    ("stability.json", "the stability analysis"),
    ("parameters.yaml", "the parameters of all nodes"),
    ("info.json", "conditions and command of the flight"),
    ("versions.json", "versions of the software"),
    ("figures", "the figures as PNG, SVG and for plotly.js, snapshots and video"),
    ("logs", "what each process printed"),
)


def write_page(directory: Path, rendered: Rendered | None = None) -> Path:
    """Write `directory`/report.html from the files in the result folder; return its path.

    rendered: result of the renderer; without it the page shows the existing pictures. Raises
    ResultFolderError for a file that is no JSON.
    """
    metrics = _json(directory / "metrics.json")
    info = _json(directory / "info.json")
    controller = catalogue.label(metrics.get("controller"))
    rendered = rendered or existing(directory)
    try:
        comparison, no_parameters = parameters.compare(directory / "parameters.yaml"), ""
    except parameters.ProfileError as error:
        comparison, no_parameters = None, str(error)
    text = templates.render(
        "uam_lab.report.page",
        "page.html.j2",
        metrics=metrics,
        info={"notes": [], "vehicle_changes": {}} | info,
        verdict=flight_summary.verdict(metrics),
        payload=flight_summary.payload_story(metrics),
        landing=flight_summary.landing_story(metrics),
        hand=flight_summary.hand_story(metrics),
        thrust=flight_summary.thrust_story(metrics),
        errors=flight_summary.error_rows(metrics),
        not_compared=flight_summary.not_compared(metrics),
        phases=flight_summary.phase_rows(metrics),
        phase_headings=flight_summary.PHASE_HEADINGS,
        clamps=flight_summary.clamp_story(metrics) if metrics.get("clamps") else None,
        changes=change_rows.rows(info),
        faults=fault_marks.rows(info),
        facts=[(label, (metrics | {"controller": controller}).get(key)) for key, label in FACTS],
        controller=controller,
        strip=_embedded(rendered.strip),
        video=_embedded(rendered.video),
        poster=_embedded(_middle(rendered.snapshots)),
        problem=rendered.problem,
        **figure_entries(directory / "figures", FIGURES),
        stability=_stability(directory / "stability.json"),
        comparison=comparison,
        no_parameters=no_parameters,
        versions=_json(directory / "versions.json"),
        command=info.get("command"),
        files=[(name, about) for name, about in FILES if (directory / name).exists()],
    )
    write_text(directory / "report.html", text)
    return directory / "report.html"


def _middle(pictures: Sequence[Path]) -> Path | None:
    """Return the picture that stands for the video before it plays."""
    return pictures[len(pictures) // 2] if pictures else None


def _stability(file: Path) -> dict[str, Any] | None:
    """Return the texts of the stability section; None without an analysis."""
    found = _json(file)
    if not found:
        return None
    return {
        "verdict": stability_rows.verdict(found),
        "rows": stability_rows.rows(found),
        "caveats": stability_rows.caveats(found),
    }


def _embedded(file: Path | None) -> str | None:
    """Return the file as a data URI, None without a file."""
    return None if file is None else templates.embedded(file)


def _json(file: Path) -> Mapping[str, Any]:
    return read_json(file) if file.exists() else {}
