"""Tables of a duel in Markdown: flown (published), per row and task."""

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
# of a pick, in the order of its published figures
PICKED: tuple[tuple[str, Callable[[DuelResult], float], int], ...] = (
    *MEASURES[:2],
    ("platform, largest [mm]", lambda r: MILLI * r.largest, 0),
    ("basket off its place [mm]", lambda r: MILLI * r.placed, 1),
)
# what is not published: its largest value of all flights
LOADING: tuple[tuple[str, Callable[[DuelResult], float], int], ...] = (
    ("off its place, worst [mm]", lambda r: MILLI * r.placed, 1),
    ("platform at the lift, worst [mm]", lambda r: MILLI * r.lift, 0),
    ("at the set-down, worst [mm]", lambda r: MILLI * r.set_down, 0),
    ("rho, worst", lambda r: r.rho, 2),
)


def text(duel: Duel, results: Results) -> str:
    """Return all tables."""
    picks = [name for name, load in duel.loads.items() if load]
    tasks = [name for name in duel.scenarios if name not in picks]
    tables = [_errors(duel, results, tasks, k) for k in range(len(MEASURES)) if tasks]
    tables += [_picks(duel, results, name) for name in picks]
    return "\n\n".join([*tables, _robust(duel, results)]) + "\n"


def mean(values: Iterable[float]) -> float:
    """Return the mean of the finite values, NaN without one."""
    finite = [value for value in values if np.isfinite(value)]
    return float(np.mean(finite)) if finite else float("nan")


def _errors(duel: Duel, results: Results, tasks: Sequence[str], measure: int) -> str:
    """Return rows × tasks of a measure."""
    rows = [
        [label, *(_cell(duel, results, label, task, MEASURES, measure) for task in tasks)]
        for label in dict.fromkeys((*duel.published, *duel.rows))
    ]
    return markdown_table([MEASURES[measure][0], *tasks], rows)


def _picks(duel: Duel, results: Results, task: str) -> str:
    """Return rows × measures of a pick."""
    rows = []
    for label in dict.fromkeys((*duel.published, *duel.rows)):
        own = [r for r in _of(results, label, task) if r.done]
        cells = [_cell(duel, results, label, task, PICKED, k) for k in range(len(PICKED))]
        worst = [
            _shown(max(map(value, own), default=np.nan), digits) for _, value, digits in LOADING
        ]
        rows.append([label, *cells, *worst])
    return markdown_table([task, *(head for head, *_ in (*PICKED, *LOADING))], rows)


def _cell(
    duel: Duel, results: Results, label: str, task: str, measures: Sequence[tuple], number: int
) -> str:
    """Return the mean of the completed flights, and the published figure in brackets."""
    _, value, digits = measures[number]
    said = duel.published.get(label, {}).get(task)
    told = "" if said is None else f" ({said[number]:g})"
    return _shown(mean(map(value, _of(results, label, task))), digits) + told


def _shown(value: float, digits: int) -> str:
    return "-" if np.isnan(value) else f"{value:.{digits}f}"


def _robust(duel: Duel, results: Results) -> str:
    """Return worst joint, standing offset, survived delay, and ended flights of each row."""
    rows = []
    for label in duel.rows:
        own = [r for r in results if r.row == label and not r.delay]
        joint = mean(r.joint for r in own)
        offset = MILLI * mean(r.standing for r in own)
        early, lost = sum(not r.done for r in own), sum(r.lost for r in own)
        numbers = [_shown(joint, 2), _shown(offset, 1), survived(results, label)]
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
