"""The files of a design: profile, gains of the autopilot, pictures of its margins; its table."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import yaml

from uam_control.settings.atomic import write_text
from uam_control.settings.parameter_file import as_text
from uam_control.vehicle import AUTOPILOT_FILE, PROFILE_FILE, VehicleDescription, designed
from uam_lab.experiments.design.criteria import DesignError
from uam_lab.experiments.design.search import RATES, Design
from uam_lab.experiments.margins import report
from uam_lab.records.results.templates import markdown_table, shown
from uam_lab.report.figures import style

MADE = "# uam vehicle design"  # first words of a file that a later design may replace
PICTURES = (("bode", report.bode), ("step", report.steps))
HEAD = ("loop", "crossover rad/s", "phase deg", "gain dB", "delay ms", "peak", "limited by")


def files_of(described: VehicleDescription, folder: Path) -> dict[str, Path]:
    """Return profile, autopilot and pictures of a vehicle's design in `folder`, by kind.

    Raises DesignError for one that is there and was written by hand.
    """
    found = {
        kind: folder / designed(described.file, kind).name
        for kind in (PROFILE_FILE, AUTOPILOT_FILE)
    }
    for file in found.values():
        if file.exists() and not file.read_text(encoding="utf-8").startswith(MADE):
            raise DesignError(f"{file} is not a design's: --out writes to another folder")
    return found | {name: folder / f"{described.file.stem}_{name}.png" for name, _ in PICTURES}


def write(made: Design, files: Mapping[str, Path]) -> None:
    """Write the files of `files_of`."""
    head = f"{MADE} {made.described.file.name}\n"
    limits = "".join(f"# {loop}: {why}\n" for loop, why in made.limits.items())
    lines = head + "# what keeps each loop from being faster:\n" + limits
    write_text(files[PROFILE_FILE], lines + as_text(made.profile.sections))
    gains = yaml.safe_dump(made.described.autopilot_gains, sort_keys=False)
    write_text(files[AUTOPILOT_FILE], head + gains)
    with style.styled():
        for name, draw in PICTURES:
            style.save(draw(made.cases), files[name])


def table(made: Design) -> str:
    """Return the table in Markdown, the least margins over all operating points of the design."""
    found = [case.analysis for case in made.cases]
    delay = 1e3 * min(one.setpoint_delay for one in found)
    name, labels = made.described.name, ", ".join(case.label for case in made.cases)
    return "\n\n".join(
        [
            f"{name}, hover, linear; least margins of: {labels}",
            markdown_table(HEAD, _rows(made)),
            f"setpoints may come {delay:.0f} ms later",
        ]
    )


def _rows(made: Design) -> Iterator[list[str]]:
    for loop in made.cases[0].analysis.loops:
        seen = [case.analysis.loops[loop][1] for case in made.cases]
        yield [
            loop,
            f"{min(one.crossover for one in seen):.3g}",
            f"{min(abs(one.phase) for one in seen):.0f}",
            shown(min(min(one.gain, one.gain_down) for one in seen), 1),
            shown(1e3 * min(one.delay for one in seen), 0),
            f"{max(one.peak for one in seen):.2f}",
            made.limits[loop],
        ]
    if RATES in made.limits:
        yield [RATES, "", "", "", "", "", made.limits[RATES]]
