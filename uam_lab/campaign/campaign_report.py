"""Results of `uam campaign`: every flight, success rate, and comparison of the failed flights."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from uam_control.coordinates import BASE_COORDINATES, POSITION
from uam_lab.campaign.fault_outcome import COMPLETED, OUTCOMES, counts
from uam_lab.campaign.trial import TrialResult
from uam_lab.campaign.variations import Draw, common
from uam_lab.report.figures import style
from uam_lab.results.atomic import replacing, write_rows, write_text
from uam_lab.results.result_folder import as_json, versions

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
    _flights(out / "flights.csv", draws, results)
    summary = _summary(draws, results, failed, rms, vehicle, command)
    write_text(out / "summary.md", summary)
    write_text(
        out / "campaign.json",
        as_json(
            {
                "command": command,
                "vehicle": vehicle,
                "versions": versions(),
                "flights": len(results),
                "outcomes": counts(r.outcome for r in results),
                "rms_percentiles": {str(p): np.percentile(rms, p, axis=0) for p in PERCENTILES},
                "columns": results[0].coordinates,
                "failures_have_in_common": common(draws, failed),
            }
        ),
    )
    with style.styled(), replacing(out / "campaign.png") as temporary:
        _figure(draws, results, vehicle, rms).savefig(
            temporary, format="png", dpi=style.PIXELS_PER_INCH
        )
    return summary


def _flights(file: Path, draws: Sequence[Draw], results: Sequence[TrialResult]) -> None:
    head = [
        "flight",
        *draws[0].values,
        *(f"rms {n}" for n in results[0].coordinates),
        "outcome",
        "why",
    ]
    write_rows(
        file,
        head,
        (
            [
                i,
                *(f"{x:.4g}" for x in draw.values.values()),
                *(f"{x:.4g}" for x in r.rms),
                r.outcome,
                r.why,
            ]
            for i, (draw, r) in enumerate(zip(draws, results, strict=True))
        ),
    )


def _summary(
    draws: Sequence[Draw],
    results: Sequence[TrialResult],
    failed: Sequence[bool],
    rms: np.ndarray,
    vehicle: str,
    command: str,
) -> str:
    count, bad = len(results), sum(failed)
    others = {o: n for o, n in counts(r.outcome for r in results).items() if n and o != COMPLETED}
    listed = ", ".join(f"{number} {outcome}" for outcome, number in others.items())
    lines = [
        f"{vehicle}: {count - bad} of {count} flights completed the mission "
        f"({100.0 * (count - bad) / count:.1f} %); {listed or 'none lost'}.",
        "",
        *(f"- {outcome}: {OUTCOMES[outcome]}" for outcome in others),
        "",
        "| RMS error | " + " | ".join(f"{p} % of flights below" for p in PERCENTILES) + " |",
        "|---|" + "---|" * len(PERCENTILES),
    ]
    for i, name in enumerate(results[0].coordinates):
        unit, digits = ("m", 3) if name in BASE_COORDINATES[POSITION] else ("deg", 2)
        cells = [f"{np.percentile(rms[:, i], p):.{digits}f} {unit}" for p in PERCENTILES]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    shared = common(draws, failed)
    if shared:
        head = ("", "their mean", "mean of the others", "distance [standard deviations]")
        lines += [
            "",
            "Conditions of the flights that were not completed, the largest distance first:",
            "",
            f"| {' | '.join(head)} |",
            "|---|---|---|---|",
        ]
        lines += [f"| {n} | {a:.3g} | {b:.3g} | {d:+.2f} |" for n, a, b, d in shared]
        reasons = sorted({_kind(r.why) for r in results if not r.completed})
        lines += [
            "",
            "Reasons: "
            + "; ".join(
                f"{kind}: {sum(_kind(r.why) == kind for r in results if not r.completed)}"
                for kind in reasons
            )
            + ".",
        ]
    return "\n".join([*lines, "", f"Made by `{command}`."]) + "\n"


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
