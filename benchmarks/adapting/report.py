"""Tables of a study in Markdown, and the sentences that follow from them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adapting.description import Study
from adapting.flights import StudyResult
from adapting.run import PROPOSED, Margin, Swept
from uam_lab.records.results.templates import markdown_table
from uam_lab.records.results.timeseries import SUBSYSTEMS

LOOPS = (("x", "y", "z"), ("roll", "pitch", "yaw", "setpoints"))
UNITS = {"position": ("3-D RMSE [mm]", 1e3, 0), "attitude": ("worst angle, RMS [deg]", 1.0, 2)}
UNITS["arm"] = ("worst joint, RMS [deg]", 1.0, 2)


def margin_table(found: Sequence[Margin]) -> str:
    """Return the smallest delay margin of each subsystem, and the least distance from -1."""
    rows = []
    for one in found:
        arm = [k for k in one.delay if k.startswith("alpha")]
        groups = (*LOOPS, arm)
        delays = [f"{1e3 * min(one.delay[k] for k in group):.1f}" for group in groups]
        near = [min(one.distance[k] for k in g if k in one.distance) for g in groups]
        rows.append([one.row, *delays, *(f"{value:.2f}" for value in near), f"{one.share:.2f}"])
    head = ["margins", *(f"delay, {name} [ms]" for name in SUBSYSTEMS)]
    head += [*(f"distance, {name}" for name in SUBSYSTEMS), "share of PD's"]
    return markdown_table(head, rows)


def mean(results: Sequence[StudyResult], part: int) -> float:
    """Return the mean error of a subsystem over the seeds; NaN without flights."""
    values = [result.errors[part] for result in results]
    return float(np.mean(values)) if values else float("nan")


def of(results: Sequence[StudyResult], row: str, condition: str) -> list[StudyResult]:
    """Return the results of a row in a condition."""
    return [r for r in results if (r.row, r.condition) == (row, condition)]


def error_table(study: Study, results: Sequence[StudyResult], subsystem: str) -> str:
    """Return rows × conditions; with the number of flights that were not flown to the end."""
    unit, factor, digits = UNITS[subsystem]
    part = SUBSYSTEMS.index(subsystem)
    conditions = [one.label for one in study.conditions]
    rows = []
    for row in study.rows:
        cells = []
        for condition in conditions:
            own = of(results, row.label, condition)
            value, failed = mean(own, part), sum(not r.flown for r in own)
            text = "" if np.isnan(value) else f"{factor * value:.{digits}f}"
            cells.append(text + (f" ({failed} of {len(own)} ended early)" if failed else ""))
        rows.append([row.label, *cells])
    return markdown_table([f"{subsystem}: {unit}", *conditions], rows)


def share_table(study: Study, results: Sequence[StudyResult], condition: str) -> str:
    """Return the shares of the true coupling that each term carries, per row, in per cent."""
    rows = []
    for row in study.rows:
        cells = []
        for subsystem in SUBSYSTEMS:
            own = of(results, row.label, condition)
            found = [r.shares[subsystem] for r in own if subsystem in r.shares]
            for term in ("adaptive", "feedback", "added", "actuators"):
                values = [one[term] for one in found if one[term] is not None]
                cells.append(f"{100.0 * np.mean(values):.0f}" if values else "")
        rows.append([row.label, *cells])
    terms = ("adaptation", "feedback", "added", "autopilot")
    head = [f"share of the coupling [%], {condition}"]
    head += [f"{subsystem}: {term}" for subsystem in SUBSYSTEMS for term in terms]
    return markdown_table(head, rows)


def shares_by_condition(study: Study, results: Sequence[StudyResult], row: str) -> str:
    """Return the share that adaptation carries in every condition, in per cent."""
    rows = []
    for subsystem in SUBSYSTEMS:
        cells = []
        for condition in study.conditions:
            value = adaptive_share(results, row, condition.label, subsystem)
            cells.append("" if np.isnan(value) else f"{100.0 * value:.0f}")
        rows.append([subsystem, *cells])
    head = [f"{row}: adaptation carries [%]", *(one.label for one in study.conditions)]
    return markdown_table(head, rows)


def adaptive_share(
    results: Sequence[StudyResult], row: str, condition: str, subsystem: str
) -> float:
    """Return the mean share over the seeds, NaN without one."""
    own = [r.shares[subsystem]["adaptive"] for r in of(results, row, condition) if r.shares]
    return float(np.mean(own)) if own else float("nan")


def sweep_table(found: Sequence[Swept], first: str) -> str:
    """Return one line per flight of a sweep."""
    rows = []
    for one in found:
        result = one.result
        shares = [
            f"{100.0 * result.shares[name]['adaptive']:.0f}" if result.shares else ""
            for name in SUBSYSTEMS
        ]
        rows.append(
            [
                f"{one.what} {one.value:g}",
                result.condition,
                f"{1e3 * result.errors[0]:.0f}",
                *(f"{value:.2f}" for value in result.errors[1:]),
                *shares,
                f"{1e3 * one.arm_delay:.1f}",
                f"{1e3 * one.setpoint_delay:.1f}",
                result.outcome,
            ]
        )
    head = [first, "flight", "position [mm]", "attitude [deg]", "arm [deg]"]
    head += [f"{name}: adaptation [%]" for name in SUBSYSTEMS]
    return markdown_table(
        [*head, "delay margin, arm [ms]", "delay margin, setpoints [ms]", "end"], rows
    )


def sentences(study: Study, results: Sequence[StudyResult]) -> list[str]:
    """Return what the flights say of the paper's claim, per subsystem and against each row."""
    said = []
    conditions = [one.label for one in study.conditions]
    for subsystem in SUBSYSTEMS:
        values = [adaptive_share(results, PROPOSED, c, subsystem) for c in conditions]
        values = [value for value in values if not np.isnan(value)]
        above = sum(value > 0.5 for value in values)
        if values:
            said.append(
                f"{subsystem}: adaptation of the proposed law carries {100 * min(values):.0f} to "
                f"{100 * max(values):.0f} % of the coupling, more than half in {above} of "
                f"{len(values)} conditions."
            )
    for row in study.rows:
        if row.label == PROPOSED:
            continue
        parts = []
        for part, subsystem in enumerate(SUBSYSTEMS):
            ratio, wins, count = compare(results, row.label, conditions, part)
            if count:
                parts.append(f"{subsystem} × {ratio:.2f} (smaller in {wins} of {count})")
        if parts:
            said.append(f"Error of the proposed law / that of {row.label}: {', '.join(parts)}.")
    for row in study.rows:
        own = [r for r in results if r.row == row.label]
        failed = [f"{r.condition}, seed {r.seed}: {r.outcome}" for r in own if not r.flown]
        if failed:
            said.append(f"{row.label}: {len(failed)} of {len(own)} flights not flown to the end.")
    return said


def compare(
    results: Sequence[StudyResult], other: str, conditions: Sequence[str], part: int
) -> tuple[float, int, int]:
    """Return the geometric mean of proposed / other over the conditions that both complete, the
    number in which the proposed error is smaller, and their number."""
    ratios = []
    for condition in conditions:
        mine, theirs = of(results, PROPOSED, condition), of(results, other, condition)
        if mine and theirs and all(r.flown for r in (*mine, *theirs)):
            ratio = mean(mine, part) / mean(theirs, part)
            ratios += [ratio] if np.isfinite(ratio) else []
    if not ratios:
        return float("nan"), 0, 0
    return float(np.exp(np.mean(np.log(ratios)))), sum(r < 1.0 for r in ratios), len(ratios)
