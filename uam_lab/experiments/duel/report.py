"""Tables of a duel in Markdown: published / flown, per row and task."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from uam_lab.experiments.duel.flights import MILLI, Duel, DuelResult
from uam_lab.records.results.templates import markdown_table

Results = Sequence[DuelResult]
MEASURES: tuple[tuple[str, Callable[[DuelResult], float], int], ...] = (
    ("end effector, RMSE [mm]", lambda r: MILLI * r.hand, 1),
    ("platform, RMSE [mm]", lambda r: MILLI * r.platform, 1),
    ("heading, RMSE [deg]", lambda r: r.heading, 2),
)


def text(duel: Duel, results: Results) -> str:
    """Return all tables."""
    tables = [_errors(duel, results, k) for k in range(len(MEASURES))]
    return "\n\n".join([*tables, _robust(duel, results)]) + "\n"


def mean(values: Iterable[float]) -> float:
    """Return the mean of the finite values, NaN without one."""
    finite = [value for value in values if np.isfinite(value)]
    return float(np.mean(finite)) if finite else float("nan")


def _errors(duel: Duel, results: Results, measure: int) -> str:
    """Return rows × scenarios of a measure: mean of the completed flights (published figure)."""
    head, value, digits = MEASURES[measure]
    rows = []
    for label in dict.fromkeys((*duel.published, *duel.rows)):
        cells = []
        for scenario in duel.scenarios:
            flown = mean(value(r) for r in _of(results, label, scenario))
            said = duel.published.get(label, {}).get(scenario)
            told = "" if said is None else f" ({said[measure]:g})"
            cells.append(("-" if np.isnan(flown) else f"{flown:.{digits}f}") + told)
        rows.append([label, *cells])
    return markdown_table([head, *duel.scenarios], rows)


def _robust(duel: Duel, results: Results) -> str:
    """Return worst joint, standing offset, survived delay, and ended flights of each row."""
    rows = []
    for label in duel.rows:
        own = [r for r in results if r.row == label and not r.delay]
        joint = mean(r.joint for r in own)
        offset = MILLI * mean(r.standing for r in own)
        early, lost = sum(not r.done for r in own), sum(r.lost for r in own)
        numbers = [f"{joint:.2f}", f"{offset:.1f}", survived(results, label)]
        rows.append([label, *numbers, f"{early} of {len(own)}", str(lost)])
    head = ["row", "worst joint, RMSE [deg]", "standing offset [mm]", "survived delay [ms]"]
    return markdown_table([*head, "ended early", "lost"], rows)


def survived(results: Results, label: str) -> str:
    """Return the largest delay [ms] up to which every hover of a row was completed."""
    tried = sorted((r.delay, r.done) for r in results if r.row == label and r.delay)
    best, end = 0.0, ""
    for delay, done in tried:
        if not done:
            break
        best = delay
    else:
        end = " or more"
    return f"{best:g}{end}" if tried else ""


def _of(results: Results, label: str, scenario: str) -> list[DuelResult]:
    return [r for r in results if (r.row, r.scenario) == (label, scenario) and not r.delay]
