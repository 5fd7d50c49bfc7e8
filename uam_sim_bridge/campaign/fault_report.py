"""What a campaign of faults leaves: every flight as CSV, the matrix as Markdown, picture, page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from uam_sim_bridge.campaign.fault_matrix import NOMINAL, Matrix
from uam_sim_bridge.campaign.fault_outcome import (
    COMPLETED,
    FAILSAFE,
    HELD,
    LANDED,
    LOST,
    OUTCOMES,
    counts,
)
from uam_sim_bridge.campaign.fault_trial import FaultResult
from uam_sim_bridge.flight.atomic import replacing, write_rows, write_text
from uam_sim_bridge.flight.result_folder import as_json, versions
from uam_sim_bridge.report import html, style

COLOURS = {
    COMPLETED: "#5aa469",
    HELD: "#8fb8de",
    LANDED: "#e3c567",
    FAILSAFE: "#e39b50",
    LOST: "#cf5b4a",
}
HEAD = ("fault", "moment", "outcome", "position_m", "attitude_deg", "arm_deg", "duration_s", "why")


def write(
    out: Path, matrix: Matrix, results: Sequence[FaultResult], command: str
) -> tuple[str, Path]:
    """Write flights.csv, faults.json, summary.md, matrix.png and report.html; (summary, page)."""
    write_rows(
        out / "flights.csv",
        HEAD,
        (
            [
                r.fault,
                r.moment,
                r.outcome,
                *(_shown(worst(r, key)) for key in HEAD[3:6]),
                f"{r.duration_s:.2f}",
                r.why,
            ]
            for r in results
        ),
    )
    write_text(
        out / "faults.json",
        as_json(
            {
                "command": command,
                "versions": versions(),
                "matrix": vars(matrix),
                "flights": [vars(result) for result in results],
            }
        ),
    )
    summary = markdown(matrix, results, command)
    write_text(out / "summary.md", summary)
    with style.styled(), replacing(out / "matrix.png") as temporary:
        picture(matrix, results).savefig(temporary, format="png", dpi=style.PIXELS_PER_INCH)
    page = out / "report.html"
    write_text(page, _page(out, matrix, results, command))
    return summary, page


def worst(result: FaultResult, key: str) -> float:
    """Largest error of a group over its axes, in the unit of the key; NaN if it never flew."""
    values = [v for v in result.worst.get(key, ()) if v is not None]
    return max(values, default=math.nan)


def sentence(results: Sequence[FaultResult]) -> str:
    """How many flights ended how."""
    counted = counts(result.outcome for result in results if result.fault != NOMINAL)
    parts = [f"{number} {outcome}" for outcome, number in counted.items() if number]
    nominal = next((r.outcome for r in results if r.fault == NOMINAL), "not flown")
    return (
        f"{sum(counted.values())} flights with a fault: {', '.join(parts)}. "
        f"Without a fault: {nominal}."
    )


def markdown(matrix: Matrix, results: Sequence[FaultResult], command: str) -> str:
    """The matrix as a table: outcome and largest position error."""
    cells = {(r.fault, r.moment): r for r in results}
    lines = [
        sentence(results),
        "",
        f"| fault | {' | '.join(matrix.moments)} |",
        "|---|" + "---|" * len(matrix.moments),
    ]
    for row in matrix.rows:
        shown = [_cell(cells[row, moment]) for moment in matrix.moments]
        lines.append(f"| {row} | {' | '.join(shown)} |")
    lines += [
        "",
        "In each cell: how it ended, and the largest position error. "
        + "; ".join(f"{name}: {about}" for name, about in OUTCOMES.items())
        + ".",
    ]
    if matrix.left_out:
        lines += ["", f"Only with --engine ros: {'; '.join(matrix.left_out)}."]
    return "\n".join([*lines, "", f"Made by `{command}`."]) + "\n"


def picture(matrix: Matrix, results: Sequence[FaultResult]) -> Figure:
    """The matrix in colours, with the largest position error in each cell."""
    rows, columns = matrix.rows, list(matrix.moments)
    cells = {(r.fault, r.moment): r for r in results}
    figure = Figure(figsize=(style.WIDTH, 1.3 + 0.27 * len(rows)), layout="constrained")
    axis = figure.subplots()
    axis.imshow(
        [[to_rgb(COLOURS[cells[row, column].outcome]) for column in columns] for row in rows],
        aspect="auto",
    )
    for i, row in enumerate(rows):
        for j, column in enumerate(columns):
            result = cells[row, column]
            axis.text(
                j,
                i,
                f"{result.outcome}  {_metres(result)}",
                ha="center",
                va="center",
                fontsize=7.5,
                color=style.INK,
            )
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


def _cell(result: FaultResult) -> str:
    return f"{result.outcome} {_metres(result)}".strip()


def _metres(result: FaultResult) -> str:
    value = worst(result, "position_m")
    return "" if math.isnan(value) else f"{value:.2f} m"


def _shown(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.4g}"


def _page(out: Path, matrix: Matrix, results: Sequence[FaultResult], command: str) -> str:
    return html.template("uam_sim_bridge.campaign", "faults.html.j2").render(
        sentence=sentence(results),
        matrix=matrix,
        outcomes=OUTCOMES,
        colours=COLOURS,
        picture=html.embedded(out / "matrix.png"),
        command=command,
        rows=[(r, [_shown(worst(r, key)) for key in HEAD[3:6]]) for r in results],
    )
