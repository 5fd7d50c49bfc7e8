"""Results of `uam compare`: tables, figures, every flight, one page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from uam_lab.campaign.trial import Trial, TrialResult
from uam_lab.compare import plan, tables
from uam_lab.compare.modularity import Evidence
from uam_lab.report.figures import figures, style
from uam_lab.report.figures.panels import DrawnFlight
from uam_lab.report.page import html
from uam_lab.results import timeseries
from uam_lab.results.atomic import replacing, write_rows, write_text
from uam_lab.results.result_folder import as_json, versions

# The paper's five figures; OVERLAID: the rows drawn in them.
PAPERS_FIGURES = (
    "position_errors",
    "attitude_errors",
    "arm_errors",
    "vehicle_inputs",
    "arm_inputs",
)
OVERLAID = (plan.ASMC1, plan.ASMC2, plan.PROPOSED)


@dataclass(frozen=True)
class Written:
    """text: for the console; page: report.html."""

    text: str
    page: Path


def budgets(rows: Sequence[plan.ComparedController]) -> dict[str, str]:
    """Return the source of each profile's values: the comment at the beginning of its file."""
    found = {}
    for row in rows:
        if not row.profile.file.is_file():
            continue
        lines = row.profile.file.read_text().splitlines()
        head = []
        for line in lines:
            if not line.startswith("#"):
                break
            head.append(line.lstrip("# "))
        found[row.label] = " ".join(head)
    return found


def write(
    out: Path,
    trials: Sequence[Trial],
    results: Sequence[TrialResult],
    modular: Evidence,
    facts: Mapping[str, Any],
) -> Written:
    """Write flights.csv, comparison.json, tables.md, figures/ and report.html to `out`."""
    found = tables.rows(results)
    claims = [*tables.claims(found), modular.claim]
    markdown = tables.as_markdown(found)
    for table in modular.tables():
        markdown += "\n" + _markdown(*table)
    _flights(out / "flights.csv", results)
    numbers = {
        row.label: {
            "flights": row.flights,
            "completed": row.completed,
            "lost": row.lost,
            "mean": row.mean,
            "half_width": row.half_width,
            "worst": row.worst,
        }
        for row in found
    }
    write_text(
        out / "comparison.json",
        as_json(
            {
                "columns": found[0].coordinates,
                **facts,
                "versions": versions(),
                "rows": numbers,
                "claims": claims,
            }
        ),
    )
    write_text(
        out / "tables.md",
        markdown
        + "\n"
        + "\n".join(f"- {claim}" for claim in claims)
        + f"\n\nVehicle {facts['vehicle']}, scenario {facts['scenario']}. Made by "
        f"`{facts['command']}`; ± is the {tables.CONFIDENCE:.0%} confidence "
        "interval over seeds.\n",
    )
    drawn = _draw(out, trials, results)
    page = out / "report.html"
    write_text(page, _page(found, claims, modular, drawn, out, facts))
    return Written(markdown + "\n" + "\n".join(claims) + "\n", page)


def _flights(file: Path, results: Sequence[TrialResult]) -> None:
    head = [
        "controller",
        "payload_kg",
        "seed",
        *(f"rms {n}" for n in results[0].coordinates),
        "outcome",
        "place_error_m",
        "why",
    ]
    write_rows(
        file,
        head,
        (
            [
                r.label,
                r.payload_mass,
                r.seed,
                *(f"{x:.6g}" for x in r.rms),
                r.outcome,
                "" if r.place_error is None else f"{r.place_error:.4f}",
                r.why,
            ]
            for r in results
        ),
    )


def _draw(out: Path, trials: Sequence[Trial], results: Sequence[TrialResult]) -> list[str]:
    kept = {trial.label: trial.keep for trial in trials if trial.keep is not None}
    flights = [
        DrawnFlight(label, timeseries.read(kept[label])) for label in OVERLAID if label in kept
    ]
    drawn = figures.draw(flights, out / "figures", names=PAPERS_FIGURES)
    with style.styled():
        for name, figure in (("rms", _rms(tables.rows(results))), ("gains", _gains(results))):
            with replacing(out / "figures" / f"{name}.png") as temporary:
                figure.savefig(temporary, format="png", dpi=style.PIXELS_PER_INCH)
            drawn.append(name)
    return drawn


def _rms(found: Sequence[tables.ControllerErrors]) -> Figure:
    """Draw the RMS errors of every row beside the paper's, on a logarithmic scale."""
    figure = Figure(figsize=(style.WIDTH, 4.2), layout="constrained")
    axis = figure.subplots()
    width = 0.8 / len(found)
    names = found[0].coordinates
    at = np.arange(len(names))
    for number, row in enumerate(found):
        colour = style.FLIGHTS[number % len(style.FLIGHTS)]
        x = at + (number - 0.5 * (len(found) - 1)) * width
        error = np.nan_to_num(row.half_width)
        axis.bar(
            x,
            row.mean,
            width,
            yerr=error,
            color=colour,
            label=row.label,
            ecolor=style.INK,
            error_kw={"linewidth": 0.7},
        )
        if row.label in tables.PAPER:
            published = tables.PAPER[row.label]
            axis.plot(x[: len(published)], published, "_", color=style.INK, markersize=9)
    axis.plot([], [], "_", color=style.INK, label="the paper's")
    axis.set(yscale="log", xticks=at, xticklabels=names, ylabel="RMS error [m, deg]")
    axis.set_title("RMS errors over all flights", loc="left")
    axis.legend(ncols=3, loc="upper left", bbox_to_anchor=(0.0, -0.08))
    return figure


def _gains(results: Sequence[TrialResult]) -> Figure:
    """Draw the largest value of each adapted gain of the proposed law, one dot per flight."""
    flights = [r for r in results if r.label == plan.PROPOSED]
    names = [n for n in (flights[0].peaks if flights else {}) if n.rsplit(".", 1)[1][0] in "Kz"]
    figure = Figure(figsize=(style.WIDTH, 3.2), layout="constrained")
    axis = figure.subplots()
    masses = sorted({r.payload_mass for r in flights})
    for number, mass in enumerate(masses):
        own = [r for r in flights if r.payload_mass == mass]
        for i, name in enumerate(names):
            values = [r.peaks[name] for r in own if name in r.peaks]
            axis.plot(
                [i + 0.2 * (number - 1)] * len(values),
                values,
                ".",
                color=style.FLIGHTS[number % len(style.FLIGHTS)],
                label=f"{mass:g} kg" if i == 0 else None,
            )
    axis.set(yscale="log", xticks=range(len(names)), ylabel="largest value in a flight")
    axis.set_xticklabels(names, rotation=40, ha="right", fontsize=7.5)
    axis.set_title(
        "Adapted gains of the proposed law stay bounded: the largest of each flight", loc="left"
    )
    if names:
        axis.legend(ncols=3)
    return figure


def _markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def _page(
    found: Sequence[tables.ControllerErrors],
    claims: Sequence[str],
    modular: Evidence,
    drawn: Sequence[str],
    out: Path,
    facts: Mapping[str, Any],
) -> str:
    pictures = [(name, html.embedded(out / "figures" / f"{name}.png")) for name in drawn]
    shown = [
        {
            "title": title,
            "unit": "m" if title == "position" else "deg",
            "names": found[0].coordinates[columns],
            "rows": [_html_row(row, found, columns, title) for row in found],
        }
        for title, columns in tables.TABLES
    ]
    return html.template("uam_lab.compare", "report.html.j2").render(
        tables=shown,
        claims=claims,
        modularity=modular.tables(),
        pictures=pictures,
        facts=facts,
        confidence=tables.CONFIDENCE,
        shown=OVERLAID,
    )


def _html_row(
    row: tables.ControllerErrors,
    found: Sequence[tables.ControllerErrors],
    columns: slice,
    title: str,
) -> dict:
    digits = 4 if title == "position" else 3
    proposed = next((other for other in found if other.label == plan.PROPOSED), None)
    papers = tables.papers(row)
    cells = []
    for i in range(*columns.indices(len(row.mean))):
        worse = ""
        if proposed is not None and row is not proposed:
            worse = f"{tables.degradation(row.mean, proposed.mean)[i]:.0f} %"
        cells.append(
            {
                "ours": tables.cell(row.mean[i], row.half_width[i], digits),
                "paper": papers[i],
                "worse": worse,
            }
        )
    return {"label": row.label, "shortfall": row.shortfall, "cells": cells}
