"""Results of `uam faults`: every flight as CSV; the matrix as Markdown, picture and page."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from uam_control.settings.atomic import write_rows, write_text
from uam_lab.experiments.faults.matrix import NOMINAL, Matrix
from uam_lab.experiments.faults.trial import FaultResult
from uam_lab.experiments.trials.outcome import (
    COMPLETED,
    FAILSAFE,
    HELD,
    LANDED,
    LOST,
    OUTCOMES,
    REFUSED,
    counts,
)
from uam_lab.records.results import templates
from uam_lab.records.results.result_folder import versions, write_json
from uam_lab.report.figures import style

COLOURS = {
    REFUSED: "#b9a7d6",
    COMPLETED: "#5aa469",
    HELD: "#8fb8de",
    LANDED: "#e3c567",
    FAILSAFE: "#e39b50",
    LOST: "#cf5b4a",
}
ERRORS = ("position_m", "attitude_deg", "arm_deg")  # keys of `FaultResult.worst`
LOST_HEAD = ["lost, to repeat it", "largest tilt [°]", "at the ground [m/s]", "why"]


def write(
    out: Path,
    matrix: Matrix,
    results: Sequence[FaultResult],
    vehicle: str,
    command: str,
    again: str = "uam fly",
) -> tuple[str, Path]:
    """Write flights.csv, faults.json, summary.md, matrix.png, report.html; return summary, page.

    vehicle: its name; again: the command that repeats a flight, without its faults.
    """
    table = list(map(_row, results))
    write_rows(out / "flights.csv", table[0], (row.values() for row in table))
    facts = {"command": command, "vehicle": vehicle, "versions": versions()}
    facts |= {"matrix": asdict(matrix), "flights": [vars(result) for result in results]}
    write_json(out / "faults.json", facts)
    lost = [r for r in results if r.outcome == LOST]
    lost_rows = [
        [
            " --fault ".join([again, *r.given.split()]),
            templates.shown(r.tilt_deg, 0, ""),
            templates.shown(r.impact, 2, ""),
            r.why,
        ]
        for r in lost
    ]
    summary = markdown(matrix, results, vehicle, command)
    if lost:
        summary += f"\n{templates.markdown_table(LOST_HEAD, lost_rows)}\n"
    write_text(out / "summary.md", summary)
    with style.styled():
        style.save(picture(matrix, results), out / "matrix.png")
    page = out / "report.html"
    text = templates.render(
        "uam_lab.experiments.faults",
        "faults.html.j2",
        sentence=sentence(results),
        matrix=matrix,
        vehicle=vehicle,
        outcomes=OUTCOMES,
        colours=COLOURS,
        picture=templates.embedded(out / "matrix.png"),
        command=command,
        rows=[(r, [_shown(worst(r, key)) for key in ERRORS]) for r in results],
        lost=lost_rows,
    )
    write_text(page, text)
    return summary, page


def _row(r: FaultResult) -> dict[str, object]:
    """Return the row of a flight in flights.csv, by the heads of the columns."""
    return {
        "fault": r.fault,
        "moment": r.moment,
        "outcome": r.outcome,
        **{key: _shown(worst(r, key)) for key in ERRORS},
        "duration_s": f"{r.duration_s:.2f}",
        "down_after_s": templates.shown(r.down_after_s, 2, ""),
        "promise_kept": "" if r.kept is None else r.kept,
        "why": r.why,
        "given": r.given,
        "tilt_deg": _shown(math.nan if r.tilt_deg is None else r.tilt_deg),
        "impact_m_s": _shown(math.nan if r.impact is None else r.impact),
    }


@dataclass(frozen=True)
class Group:
    """The flights of one cell; str() gives the text of the cell."""

    results: tuple[FaultResult, ...]

    @property
    def outcome(self) -> str:
        return max((r.outcome for r in self.results), key=list(OUTCOMES).index)

    def __str__(self) -> str:
        """Outcome and its count, time to the ground, position error, and broken promises."""
        count = len(self.results)
        same = sum(r.outcome == self.outcome for r in self.results)
        often = f" {same}/{count}" if count > 1 else ""
        down = [r.down_after_s for r in self.results if r.down_after_s is not None]
        errors = [worst(r, "position_m") for r in self.results]
        error = max((e for e in errors if not math.isnan(e)), default=math.nan)
        parts = [self.outcome + often]
        parts += [f"{max(down):.1f} s"] if down else []
        parts += [] if math.isnan(error) else [f"{error:.2f} m"]
        parts += ["broken"] if any(r.kept is False for r in self.results) else []
        return " ".join(parts)


def grouped(results: Sequence[FaultResult]) -> dict[tuple[str, str], Group]:
    """Return the flights by fault and moment."""
    found: dict[tuple[str, str], tuple[FaultResult, ...]] = {}
    for one in results:
        found[one.fault, one.moment] = (*found.get((one.fault, one.moment), ()), one)
    return {key: Group(flights) for key, flights in found.items()}


def worst(result: FaultResult, key: str) -> float:
    """Return the largest error of a group over its axes, in the unit of the key; may be NaN."""
    values = [v for v in result.worst.get(key, ()) if v is not None]
    return max(values, default=math.nan)


def sentence(results: Sequence[FaultResult]) -> str:
    """Return a sentence with the number of flights per outcome."""
    counted = counts(result.outcome for result in results if result.fault != NOMINAL)
    parts = [f"{number} {outcome}" for outcome, number in counted.items() if number]
    nominal = next((r.outcome for r in results if r.fault == NOMINAL), "not flown")
    promised = [result.kept for result in results if result.kept is not None]
    kept = f" Promises kept: {sum(promised)} of {len(promised)}." if promised else ""
    return (
        f"{sum(counted.values())} flights with a fault: {', '.join(parts)}. "
        f"Without a fault: {nominal}.{kept}"
    )


def markdown(matrix: Matrix, results: Sequence[FaultResult], vehicle: str, command: str) -> str:
    """Return the matrix as a Markdown table: outcome and largest position error."""
    cells, rows = grouped(results), _flown(matrix, results)
    table = templates.markdown_table(
        ["fault", *matrix.moments],
        ([row, *(_text(cells, row, moment) for moment in matrix.moments)] for row in rows),
    )
    outcomes = "; ".join(f"{name}: {about}" for name, about in OUTCOMES.items())
    parts = [
        f"{vehicle}, {matrix.scenario}: {sentence(results)}",
        table,
        "In each cell: the outcome (the worst of several flights), the longest time from the fault "
        "to touchdown if the mission was not completed, and the largest position error. "
        f"{outcomes}.",
    ]
    if matrix.left_out:
        out = (f"{name}: {why}" for name, why in matrix.left_out.items())
        parts.append(f"Left out: {'; '.join(out)}.")
    return "\n\n".join([*parts, f"Made by `{command}`."]) + "\n"


def picture(matrix: Matrix, results: Sequence[FaultResult]) -> Figure:
    """Draw the matrix in colours, with the largest position error in each cell."""
    rows, columns = _flown(matrix, results), list(matrix.moments)
    cells = grouped(results)
    figure = Figure(figsize=(style.WIDTH, 1.3 + 0.27 * len(rows)), layout="constrained")
    axis = figure.subplots()
    axis.imshow(
        [[_colour(cells, row, column) for column in columns] for row in rows],
        aspect="auto",
    )
    for i, row in enumerate(rows):
        for j, column in enumerate(columns):
            text = _text(cells, row, column)
            axis.text(j, i, text, ha="center", va="center", fontsize=7.5, color=style.INK)
    axis.set_xticks(range(len(columns)), columns)
    axis.set_yticks(range(len(rows)), rows)
    axis.tick_params(length=0, labeltop=True, labelbottom=False)
    axis.set_xticks([j + 0.5 for j in range(len(columns) - 1)], minor=True)
    axis.set_yticks([i + 0.5 for i in range(len(rows) - 1)], minor=True)
    axis.grid(False)
    axis.grid(True, which="minor", color="white", linewidth=2.0)
    axis.tick_params(which="minor", length=0)
    axis.spines[:].set_visible(False)
    return figure


Cells = dict[tuple[str, str], Group]


def _flown(matrix: Matrix, results: Sequence[FaultResult]) -> list[str]:
    flown = {result.fault for result in results}
    return [row for row in matrix.rows if row in flown]


def _text(cells: Cells, row: str, moment: str) -> str:
    """Return the text of a cell, "" for one that was not flown."""
    return str(cells[row, moment]) if (row, moment) in cells else ""


def _colour(cells: Cells, row: str, moment: str) -> tuple[float, float, float]:
    return to_rgb(COLOURS[cells[row, moment].outcome] if (row, moment) in cells else "white")


def _shown(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.4g}"
