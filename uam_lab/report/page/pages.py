"""report.html, of a flight or of several flights overlaid; it loads nothing from the network."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from uam_control.laws import catalogue
from uam_control.profiles.profile import ProfileError
from uam_control.settings.atomic import write_text
from uam_lab.records.results import templates
from uam_lab.records.results.metrics import PASSED_ON, errors
from uam_lab.records.results.result_folder import LOG, PX4_LOG, TABLE, read_json
from uam_lab.report.facts import flight_summary, paper, parameter_table
from uam_lab.report.figures import figures, panels
from uam_lab.report.figures.figures import FIGURES
from uam_lab.report.figures.panels import DrawnFlight
from uam_lab.report.figures.zoomable import library
from uam_lab.report.video.flight_video import Rendered, existing

# the conditions that the page shows, of metrics.json: name → label
FACTS = {name: name for name in PASSED_ON if name != "vehicle"}
FACTS |= {"payload_mass_kg": "payload mass [kg]"}

FILES = (
    (LOG, "the log of all topics, a bag of ROS 2"),
    (PX4_LOG, "the log of PX4"),
    (TABLE, "one row per control tick"),
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
    shots = rendered.snapshots
    try:
        comparison, no_parameters = parameter_table.compare(directory / "parameters.yaml"), ""
    except ProfileError as error:
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
        changes=parameter_table.changes(info),
        faults=panels.fault_marks(info),
        text=parameter_table.text,
        facts=[
            (label, (metrics | {"controller": controller}).get(key)) for key, label in FACTS.items()
        ],
        controller=controller,
        strip=_embedded(rendered.strip),
        video=_embedded(rendered.video),
        poster=_embedded(shots[len(shots) // 2] if shots else None),  # before the video plays
        problem=rendered.problem,
        **figure_entries(directory / "figures", FIGURES),
        stability=_json(directory / "stability.json"),
        number=number,
        percent=percent,
        comparison=comparison,
        no_parameters=no_parameters,
        versions=_json(directory / "versions.json"),
        command=info.get("command"),
        files=[(name, about) for name, about in FILES if (directory / name).exists()],
    )
    write_text(directory / "report.html", text)
    return directory / "report.html"


def number(value: float | None) -> str:
    """Return a number as text, with at least three digits."""
    if value is None:
        return "–"
    return f"{value:.0f}" if 100.0 <= abs(value) < 1e5 else f"{value:.3g}"


def percent(fraction: float, digits: int = 1) -> str:
    """Return a fraction in percent, as text."""
    return f"{100.0 * fraction:.{digits}f} %"


def _embedded(file: Path | None) -> str | None:
    return None if file is None else templates.embedded(file)


def _json(file: Path) -> Mapping[str, Any]:
    return read_json(file) if file.exists() else {}


def figure_entries(folder: Path, names: Iterable[str]) -> dict[str, object]:
    """Return what figures.html.j2 needs: the figures that `folder` has of `names`, and plotly.js.

    Each is a picture, a data URI, which plotly.js replaces where it can: zoomable is its JSON, ""
    without. plotly.js is 4.6 MB. It is left out where no figure needs it.
    """
    found = [_entry(folder, name) for name in names if (folder / f"{name}.png").exists()]
    needed = any(one["zoomable"] for one in found)
    return {"figures": found, "library": library() if needed else ""}


def _entry(folder: Path, name: str) -> dict[str, str]:
    file = folder / f"{name}.json"
    text = file.read_text(encoding="utf-8").replace("<", "\\u003c") if file.exists() else ""
    picture = templates.embedded(folder / f"{name}.png")
    caption = FIGURES[name][1]
    return {"name": name, "caption": caption, "picture": picture, "zoomable": text}


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
        found = errors(flight.series)[group]
        rows.append((flight.label, [f"{value:.{digits}f}" for value in found]))
    return {"heading": heading, "unit": unit, "names": names, "rows": rows}
