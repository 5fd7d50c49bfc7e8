"""Results of `uam campaign`: every flight, success rate, and comparison of the failed flights."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from uam_control.coordinates import BASE_COORDINATES, POSITION
from uam_lab.campaign.fault_outcome import COMPLETED, OUTCOMES, counts
from uam_lab.campaign.trial import TrialResult
from uam_lab.campaign.variations import PER_SEED, Draw, common
from uam_lab.report.figures import style
from uam_lab.results.atomic import write_rows, write_text
from uam_lab.results.result_folder import versions, write_json
from uam_lab.results.templates import markdown_table

PERCENTILES = (50, 90, 99)


def write(
    out: Path,
    draws: Sequence[Draw],
    results: Sequence[TrialResult],
    vehicle: str,
    command: str,
) -> str:
    """Write flights.csv, campaign.json, campaign.png and summary.md; return the summary.

    vehicle: its name.
    """
    failed = [not result.completed for result in results]
    rms = np.array([result.rms for result in results])
    shared, names = common(draws, failed), results[0].coordinates
    write_rows(
        out / "flights.csv",
        ["flight", *draws[0].values, *(f"rms {n}" for n in names), "outcome", "why"],
        (
            [
                draw.trial.seed % PER_SEED,
                *(f"{x:.4g}" for x in (*draw.values.values(), *r.rms)),
                r.outcome,
                r.why,
            ]
            for draw, r in zip(draws, results, strict=True)
        ),
    )
    outcomes = counts(r.outcome for r in results)
    numbers = {
        "command": command,
        "vehicle": vehicle,
        "versions": versions(),
        "flights": len(results),
        "outcomes": outcomes,
        "rms_percentiles": {str(p): np.percentile(rms, p, axis=0) for p in PERCENTILES},
        "columns": names,
        "failures_have_in_common": shared,
    }
    write_json(out / "campaign.json", numbers)
    summary = "\n\n".join(
        [*_summary(results, outcomes, shared, rms, vehicle), f"Made by `{command}`.\n"]
    )
    write_text(out / "summary.md", summary)
    with style.styled():
        style.save(_figure(draws, results, vehicle, rms), out / "campaign.png")
    return summary


def _summary(
    results: Sequence[TrialResult],
    outcomes: Mapping[str, int],
    shared: Sequence[tuple[str, float, float, float]],
    rms: np.ndarray,
    vehicle: str,
) -> Iterator[str]:
    """Yield the paragraphs; shared: see `common`."""
    count, done = len(results), outcomes[COMPLETED]
    others = {o: n for o, n in outcomes.items() if n and o != COMPLETED}
    listed = ", ".join(f"{number} {outcome}" for outcome, number in others.items())
    yield (
        f"{vehicle}: {done} of {count} flights completed the mission "
        f"({100.0 * done / count:.1f} %); {listed or 'none lost'}."
    )
    if others:
        yield "\n".join(f"- {outcome}: {OUTCOMES[outcome]}" for outcome in others)
    errors = []
    for i, name in enumerate(results[0].coordinates):
        unit, digits = ("m", 3) if name in BASE_COORDINATES[POSITION] else ("deg", 2)
        figures = np.percentile(rms[:, i], PERCENTILES)
        errors.append([name, *(f"{value:.{digits}f} {unit}" for value in figures)])
    yield markdown_table(["RMS error", *(f"{p} % of flights below" for p in PERCENTILES)], errors)
    if not shared:
        return
    yield "Conditions of the flights that were not completed, the largest distance first:"
    head = ("", "their mean", "mean of the others", "distance [standard deviations]")
    yield markdown_table(head, ([n, f"{a:.3g}", f"{b:.3g}", f"{d:+.2f}"] for n, a, b, d in shared))
    kinds = Counter(_kind(r.why) for r in results if not r.completed)
    yield "Reasons: " + "; ".join(f"{kind}: {kinds[kind]}" for kind in sorted(kinds)) + "."


def _kind(why: str) -> str:
    """Return a reason without its numbers, so that similar ones are counted together."""
    words = [word for word in why.split(";")[0].split() if not any(c.isdigit() for c in word)]
    return " ".join(words)


def _figure(
    draws: Sequence[Draw], results: Sequence[TrialResult], vehicle: str, rms: np.ndarray
) -> Figure:
    """Draw the distribution of each RMS error and, below, each variation, completed or not."""
    failed = np.array([not result.completed for result in results])
    figure = Figure(figsize=(style.WIDTH, 5.6), layout="constrained")
    top, bottom = figure.subfigures(2, 1, height_ratios=(1.0, 1.2))
    axis = top.subplots()
    axis.violinplot(np.log10(rms), showmedians=True, widths=0.85)
    ticks = range(int(np.floor(np.log10(rms.min()))), int(np.ceil(np.log10(rms.max()))) + 1)
    axis.set(
        xticks=range(1, rms.shape[1] + 1),
        xticklabels=results[0].coordinates,
        ylabel="RMS error [m, deg]",
        yticks=list(ticks),
        yticklabels=[f"{10.0**k:g}" for k in ticks],
    )
    axis.set_title(
        f"{vehicle}: {len(results)} random flights, {failed.sum()} not completed", loc="left"
    )
    names = list(draws[0].values)
    error = np.linalg.norm(rms[:, POSITION], axis=1)
    for name, small in zip(names, bottom.subplots(2, -(-len(names) // 2)).flat, strict=False):
        values = np.array([draw.values[name] for draw in draws])
        small.plot(values[~failed], error[~failed], ".", color=style.FLIGHTS[0], markersize=2)
        small.plot(values[failed], error[failed], "x", color=style.DROP, markersize=4)
        small.set(yscale="log", xlabel=name)
    bottom.supylabel("position RMS [m]; × not completed", fontsize=8)
    return figure
