"""The paper's three tables of RMS errors, from the results of many flights."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t as student

from uam_control.coordinates import ALPHA, ARM, ATTITUDE, POSITION, coordinates
from uam_lab.experiments.compare.plan import ASMC1, ASMC2, PROPOSED
from uam_lab.experiments.trials.trial import TrialResult
from uam_lab.records.results.templates import markdown_table
from uam_lab.report.facts import paper

CONFIDENCE = 0.95
# table:error_p, table:error_q, table:error_alpha of the paper; order of the coordinates: m, deg
PAPER = {
    ASMC1: (0.15, 0.08, 0.31, 5.98, 5.33, 8.26, 2.29, 2.34),
    ASMC2: (0.09, 0.05, 0.22, 4.83, 4.74, 5.04, 1.81, 1.73),
    PROPOSED: tuple(value for group in paper.RMS.values() for value in group),
}
AIM = (0.025, 0.010, 0.045, 1.6, 1.4, 1.5, 0.6, 0.6)  # half of the paper's, rounded
TABLES = (("position", POSITION), ("attitude", ATTITUDE), ("arm", ARM))


@dataclass(frozen=True)
class ControllerErrors:
    """One controller. mean, half_width, worst (6 + n,): RMS errors, m and deg."""

    label: str
    flights: int
    flown: int  # number of those that took off
    seeds: int  # number of their seeds
    completed: int
    lost: int
    mean: np.ndarray  # over the flights that took off, NaN without any
    half_width: np.ndarray  # confidence interval over seeds, of means over payloads; NaN: one seed
    worst: np.ndarray  # largest RMS of any of them
    why: tuple[str, ...]

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the entries of mean, half_width and worst."""
        return coordinates(len(self.mean) - ALPHA)

    @property
    def shortfall(self) -> str:
        """Text with the number of flights that were not completed, "" without any."""
        short = self.flights - self.completed
        if not short:
            return ""
        grounded = self.flights - self.flown
        without = f", {grounded} of them without take-off: no errors" if grounded else ""
        return f"{short} of {self.flights} not completed{without}"


def rows(results: Sequence[TrialResult]) -> list[ControllerErrors]:
    """Return one row per label, in the order of first occurrence."""
    return [
        row(label, [r for r in results if r.label == label])
        for label in dict.fromkeys(r.label for r in results)
    ]


def row(label: str, results: Sequence[TrialResult]) -> ControllerErrors:
    """Return the row of these flights; a flight that ended early counts up to its end."""
    flown = [result for result in results if np.isfinite(result.rms).all()]
    counted = flown or results
    rms = np.array([result.rms for result in counted])
    return ControllerErrors(
        label=label,
        flights=len(results),
        flown=len(flown),
        seeds=len({result.seed for result in flown}),
        completed=sum(result.completed for result in results),
        lost=sum(result.lost for result in results),
        mean=rms.mean(axis=0),
        half_width=half_width(counted),
        worst=rms.max(axis=0),
        why=tuple(sorted({result.why for result in results if result.why})),
    )


def half_width(results: Sequence[TrialResult]) -> np.ndarray:
    """Return half the width (6 + n,) [m, deg] of Student's confidence interval of the mean."""
    seeds = sorted({result.seed for result in results})
    means = np.array(
        [np.mean([r.rms for r in results if r.seed == seed], axis=0) for seed in seeds]
    )
    count = len(seeds)
    if count < 2:
        return np.full(means.shape[1], np.nan)
    quantile = student.ppf(0.5 + 0.5 * CONFIDENCE, count - 1)
    return quantile * means.std(axis=0, ddof=1) / np.sqrt(count)


def degradation(other: np.ndarray, proposed: np.ndarray) -> np.ndarray:
    """Return the paper's "performance degradation" (other - proposed) / other (6 + n,) [%]."""
    return 100.0 * (np.asarray(other) - np.asarray(proposed)) / np.asarray(other)


def claims(found: Sequence[ControllerErrors]) -> list[str]:
    """Return one sentence per claim of the paper: whether it holds in these flights."""
    by_label = {row.label: row for row in found}
    said = []
    single = [row.label for row in found if row.seeds == 1]
    if len(single) == len(found):
        said.append("One seed only: there are no confidence intervals.")
    elif single:
        said.append(f"One seed only, without a confidence interval: {', '.join(single)}.")
    for better, worse in ((PROPOSED, ASMC1), (PROPOSED, ASMC2), (ASMC2, ASMC1)):
        if better in by_label and worse in by_label:
            said.append(_smaller(by_label[better], by_label[worse]))
    if PROPOSED in by_label:
        proposed = by_label[PROPOSED]
        said.append(_limit("the paper's proposed row", proposed, PAPER[PROPOSED]))
        said.append(_limit("half of that row", proposed, AIM))
    for row in found:
        if row.completed < row.flights:
            said.append(f"{row.label}: {row.shortfall}, {row.lost} of them lost ({row.why[0]}).")
        elif row.label == PROPOSED:
            said.append(f"{row.label}: all {row.flights} flights completed, none lost.")
    return said


def _smaller(better: ControllerErrors, worse: ControllerErrors) -> str:
    """Return the columns with smaller errors of `better`, beyond the confidence intervals."""
    apart, near, against, unknown = [], [], [], []
    for i, name in enumerate(better.coordinates):
        margin = np.nan_to_num(better.half_width[i]) + np.nan_to_num(worse.half_width[i])
        gap = worse.mean[i] - better.mean[i]
        if np.isnan(gap):
            unknown.append(name)
        else:
            (apart if gap > margin else against if gap < -margin else near).append(name)
    return (
        f"Smaller errors with {better.label} than with {worse.label}: "
        + (f"holds for {', '.join(apart)}" if apart else "holds in no column")
        + (f"; no significant difference for {', '.join(near)}" if near else "")
        + (f"; does not hold for {', '.join(against)}" if against else "")
        + (f"; unknown for {', '.join(unknown)}" if unknown else "")
        + "."
    )


def _limit(what: str, row: ControllerErrors, limit: Sequence[float]) -> str:
    # an arm may have more joints than the paper's, for which there is no limit
    judged = zip(row.coordinates, row.worst, limit, strict=False)
    missed = [name for name, worst, most in judged if not worst <= most]
    return (
        f"Worst RMS of any {row.label} flight against {what}: "
        + (
            "unknown, none took off"
            if not row.flown
            else f"missed in {', '.join(missed)}"
            if missed
            else "met in every column"
        )
        + "."
    )


def error_tables(found: Sequence[ControllerErrors]) -> list[dict[str, Any]]:
    """Return the three tables: the cells of each row as here, in the paper, and degradation [%]."""
    proposed = next((row for row in found if row.label == PROPOSED), None)
    tables = []
    for title, columns in TABLES:
        unit, digits = ("m", 4) if title == "position" else ("deg", 3)
        rows, names = [], found[0].coordinates[columns]
        for row in found:
            worse = [""] * len(names)
            if proposed is not None and row is not proposed:
                worse = degradation(row.mean, proposed.mean)[columns]
                worse = ["" if np.isnan(x) else f"{x:.0f}" for x in worse]
            values = zip(row.mean[columns], row.half_width[columns], strict=True)
            here = [cell(mean, half, digits) for mean, half in values]
            published = papers(row)[columns]
            rows.append({"row": row, "here": here, "paper": published, "degradation": worse})
        tables.append({"title": title, "unit": unit, "names": names, "rows": rows})
    return tables


def as_markdown(found: Sequence[ControllerErrors]) -> str:
    """Return the three tables with the paper's values beside those of the flights."""
    parts = []
    for table in error_tables(found):
        names = table["names"]
        head = [f"RMS {table['title']} error [{table['unit']}]", *names]
        head += [f"paper {name}" for name in names]
        head += [f"degradation {name} [%]" for name in names]
        rows = [
            [_name(one["row"]), *one["here"], *one["paper"], *one["degradation"]]
            for one in table["rows"]
        ]
        parts.append(markdown_table(head, rows))
    return "\n\n".join(parts) + "\n"


def papers(row: ControllerErrors) -> list[str]:
    """Return the paper's values (6 + n,) as text, "" for those that the paper does not have."""
    known = [f"{x:g}" for x in PAPER.get(row.label, ())]
    return known + [""] * (len(row.mean) - len(known))


def _name(row: ControllerErrors) -> str:
    return row.label + (f" ({row.shortfall})" if row.shortfall else "")


def cell(mean: float, half: float, digits: int) -> str:
    """Return a mean with half the width of its confidence interval, if there is one; "-": NaN."""
    if np.isnan(mean):
        return "-"
    return f"{mean:.{digits}f}" + ("" if np.isnan(half) else f" ± {half:.{digits}f}")
