"""Results of `uam compare`: tables, figures, every flight, one page."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from uam_control.profiles.profile import Profile
from uam_control.settings.atomic import write_text
from uam_lab.experiments.compare import plan, tables
from uam_lab.experiments.compare.modularity import Table
from uam_lab.experiments.trials.trial import Trial, TrialResult
from uam_lab.records.results import templates, timeseries
from uam_lab.records.results.result_folder import versions, write_json
from uam_lab.report.figures import figures, style
from uam_lab.report.figures.panels import DrawnFlight

# The paper's five figures; OVERLAID: the rows drawn in them, if they are flown.
PAPERS_FIGURES = (
    "position_errors",
    "attitude_errors",
    "arm_errors",
    "vehicle_inputs",
    "arm_inputs",
)
OVERLAID = (plan.ASMC1, plan.ASMC2, plan.PROPOSED)


def budgets(rows: Mapping[str, Profile]) -> dict[str, str]:
    """Return the source of each profile's values: the comment at the beginning of its file."""
    found = {}
    for label, profile in rows.items():
        if not profile.file.is_file():
            continue
        lines = profile.file.read_text(encoding="utf-8").splitlines()
        head = []
        for line in lines:
            if not line.startswith("#"):
                break
            head.append(line.lstrip("# "))
        found[label] = " ".join(head)
    return found


def write(
    out: Path,
    trials: Sequence[Trial],
    results: Sequence[TrialResult],
    modular: tuple[str, Sequence[Table]],
    facts: Mapping[str, Any],
) -> tuple[str, Path]:
    """Write comparison.json, tables.md, figures/ and report.html to `out`; return text and page."""
    found = tables.rows(results)
    modularity, modular_tables = modular
    claims = [*tables.claims(found), modularity]
    markdown = tables.as_markdown(found)
    for table in modular_tables:
        markdown += f"\n{templates.markdown_table(*table)}\n"
    numbers = {
        row.label: {
            name: value for name, value in vars(row).items() if name not in ("label", "why")
        }
        for row in found
    }
    write_json(
        out / "comparison.json",
        {"columns": found[0].coordinates, **facts, "versions": versions()}
        | {"rows": numbers, "claims": claims},
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
    page = out / "report.html"
    kept = {trial.label: trial.keep for trial in trials if trial.keep is not None}
    shown = [label for label in OVERLAID if label in kept] or list(kept)[: len(OVERLAID)]
    flights = [DrawnFlight(label, timeseries.read(kept[label])) for label in shown]
    pictures = [
        (name, templates.embedded(out / "figures" / f"{name}.png"))
        for name in _draw(out, flights, results, found)
    ]
    text = templates.render(
        "uam_lab.experiments.compare",
        "report.html.j2",
        tables=tables.error_tables(found),
        claims=claims,
        modularity=modular_tables,
        pictures=pictures,
        facts=facts,
        confidence=tables.CONFIDENCE,
        shown=shown,
    )
    write_text(page, text)
    return (markdown + "\n" + "\n".join(claims) + "\n", page)


def _draw(
    out: Path,
    flights: Sequence[DrawnFlight],
    results: Sequence[TrialResult],
    found: Sequence[tables.ControllerErrors],
) -> list[str]:
    """Write the figures, the paper's of `flights`; return their names."""
    drawn = figures.draw(flights, out / "figures", names=PAPERS_FIGURES)
    with style.styled():
        for name, figure in (("rms", _rms(found)), ("gains", _gains(results))):
            style.save(figure, out / "figures" / f"{name}.png")
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
        colour = style.flight_colour(number)
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
                color=style.flight_colour(number),
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
