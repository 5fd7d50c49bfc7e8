"""The whole report in one call; each step can also be called separately.

| step | function | writes |
|---|---|---|
| stability | `stability_of` | stability.json |
| figures | `figures.draw` | figures/*.png, *.svg |
| pictures | `flight_video.Rendering` | figures/snapshots/*.png, snapshots.png, flight.mp4 |
| page | `pages.write_page` | report.html |
"""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from uam_control.laws import catalogue
from uam_control.profiles.profile import ProfileError
from uam_lab.analysis.stability import Stability, analyse_folder
from uam_lab.records.results import timeseries
from uam_lab.records.results.result_folder import PX4_LOG, TABLE, write_json
from uam_lab.report.facts import px4_log
from uam_lab.report.figures import figures
from uam_lab.report.figures.panels import DrawnFlight
from uam_lab.report.page import pages
from uam_lab.report.video.flight_video import Rendering


@dataclass(frozen=True)
class Report:
    """Path of the page, and one line about missing pictures (empty if there is none)."""

    page: Path
    problem: str


def build_report(
    directory: Path,
    progress: Callable[[str], None] = lambda text: None,
    video: bool = True,
    pictures: bool = True,
    ulog: Path | None = None,
) -> Report:
    """Make the report of the flight in a result folder.

    Requires timeseries.parquet and metrics.json; uses info.json, parameters.yaml and versions.json
    if they exist. progress: called with a short text at the start of each step. ulog: of PX4
    (default: px4.ulg of the folder, if it is there). Raises timeseries.UnreadableFlight. A missing
    renderer is no error: see Report.problem.
    """
    directory = Path(directory)
    series = timeseries.read(directory / TABLE)
    label = catalogue.label(series.info.get("controller") or directory.name)
    with contextlib.ExitStack() as stack:
        # the pictures take longest; they are rendered while this process draws the figures
        rendering = stack.enter_context(Rendering(directory, video)) if pictures else None
        progress("stability")
        px4, without = px4_log_of(directory, series, ulog)
        flight = DrawnFlight(label, series, stability_of(directory, series), px4)
        figures.draw([flight], directory / "figures", progress)
        rendered = rendering.result(progress) if rendering else None
    progress("page")
    written = pages.write_page(directory, rendered)
    problems = filter(None, (rendered.problem if rendered else "", without))
    return Report(written, "; ".join(problems))


def px4_log_of(
    directory: Path, series: timeseries.Series, ulog: Path | None = None
) -> tuple[px4_log.Px4Log | None, str]:
    """Return PX4's log, and one line about why there is none, "" if there need not be one.

    Raises UnreadableUlog and OSError for a `ulog` that was given.
    """
    file = ulog or directory / PX4_LOG
    if ulog is None and not file.exists():
        return None, ""
    try:
        return px4_log.read(file, series), ""
    except ImportError:
        return None, px4_log.MISSING
    except (px4_log.UnreadableUlog, OSError) as error:
        if ulog is not None:
            raise
        return None, str(error)


def stability_of(directory: Path, series: timeseries.Series) -> Stability | None:
    """Analyse the flight, write stability.json and return the analysis; None if not applicable."""
    try:
        found = analyse_folder(directory, series)
    except ProfileError:  # the page reports the missing parameters
        return None
    if found is not None:
        write_json(directory / "stability.json", found.summary())
    return found
