"""Results of `uam campaign`: success rate, errors, slices by each drawn value, worst flights.

Shares and percentiles have confidence bands of 95 %.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from uam_control.coordinates import BASE_COORDINATES, POSITION
from uam_control.settings.atomic import write_text
from uam_lab.experiments.campaign.variations import common
from uam_lab.experiments.trials.outcome import COMPLETED, OUTCOMES, counts
from uam_lab.experiments.trials.trial import TrialResult
from uam_lab.records.results import templates
from uam_lab.records.results.result_folder import versions, write_json
from uam_lab.report.figures import style

Z = 1.959964  # standard deviations of a normal distribution that contain 95 %
BINS, PER_BIN = 10, 20  # of a slice: largest number of bins, least number of flights in one


def share(count: int, total: int) -> tuple[float, float, float]:
    """Return count / total and its confidence band: Wilson's score interval.

    E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209. It stays within 0 to 1 and is not empty where
    the count is 0 or the total.
    """
    p = count / total
    middle = (p + Z**2 / (2 * total)) / (1 + Z**2 / total)
    half = Z / (1 + Z**2 / total) * math.sqrt(p * (1 - p) / total + Z**2 / (4 * total**2))
    return p, min(p, middle - half), max(p, middle + half)


def percentile(values: np.ndarray, percent: float) -> tuple[float, float, float]:
    """Return a percentile and its confidence band; NaN entries do not count.

    The band is between two of the sorted values: the number of values below the percentile is
    binomially distributed, whatever the distribution of the values is. An end that would need more
    values is infinite. NaN without a value.
    """
    known = np.sort(values[np.isfinite(values)])
    if not known.size:
        return math.nan, math.nan, math.nan
    q, n = percent / 100.0, known.size
    half = Z * math.sqrt(n * q * (1.0 - q))
    first, last = math.floor(n * q - half), math.ceil(n * q + half)
    middle = float(np.percentile(known, percent))
    low = float(known[first]) if first >= 0 else -math.inf
    high = float(known[last]) if last < n else math.inf
    return middle, min(low, middle), max(high, middle)


@dataclass(frozen=True)
class Bin:
    """The flights whose value is between low and high."""

    low: float
    high: float
    flights: int
    completed: tuple[float, float, float]  # `share`
    error: tuple[float, float, float]  # percentiles 5, 50 and 95


def sliced(values: np.ndarray, failed: np.ndarray, error: np.ndarray) -> list[Bin]:
    """Divide the flights by a value, into bins of (nearly) equal numbers of flights.

    values: one per flight; failed: mask; error: one per flight, may be NaN.
    """
    count = max(1, min(BINS, len(values) // PER_BIN))
    found = []
    for rows in np.array_split(np.argsort(values, kind="stable"), count):
        known = error[rows][np.isfinite(error[rows])]
        band = np.percentile(known, (5.0, 50.0, 95.0)) if known.size else np.full(3, np.nan)
        done = int(np.count_nonzero(~failed[rows]))
        found.append(
            Bin(
                float(values[rows].min()),
                float(values[rows].max()),
                len(rows),
                share(done, len(rows)),
                tuple(float(one) for one in band),
            )
        )
    return found


MARKED = 300  # largest number of flights that are drawn one by one
COLUMNS = 4  # of small pictures
LEAST = 1e-6  # [m, deg] smallest error of the logarithmic axis
PERCENTILES = (50, 90, 99)
WORST = 10  # flights that are listed


class Flown:
    """The results of the flights, as columns."""

    def __init__(self, results: Mapping[int, TrialResult]) -> None:
        """results: by the flight's number, at least one."""
        flights = list(results.values())
        self.names = flights[0].coordinates  # of the errors
        self.rms = np.array([one.rms for one in flights])  # (flights, 6 + n) [m, deg]
        self.error = np.linalg.norm(self.rms[:, POSITION], axis=1)  # [m] RMS from the reference
        self.drawn = {  # name → value of each flight
            name: np.array([one.drawn[name] for one in flights]) for name in flights[0].drawn
        }
        self.numbers = np.array(list(results))
        self.outcome = [one.outcome for one in flights]
        self.why = [one.why for one in flights]
        self.failed = np.array([not one.completed for one in flights])

    def __len__(self) -> int:
        return len(self.numbers)

    @cached_property
    def outcomes(self) -> dict[str, int]:
        """Number of flights by outcome."""
        return counts(self.outcome)

    def worst(self, count: int) -> list[int]:
        """Return the rows of the worst flights: by outcome, then by error."""
        severity = {outcome: k for k, outcome in enumerate(OUTCOMES)}
        classes = np.array([severity[one] for one in self.outcome])
        error = np.where(np.isfinite(self.error), self.error, np.inf)
        return [int(row) for row in np.lexsort((self.numbers, -error, -classes))[:count]]


def picture(flights: Flown, vehicle: str) -> Figure:
    """Draw a violin per coordinate and, below, two small pictures per drawn value."""
    rows = -(-len(flights.drawn) // COLUMNS)
    figure = Figure(figsize=(style.WIDTH, 2.6 + 3.0 * rows), layout="constrained")
    top, bottom = figure.subfigures(2, 1, height_ratios=(2.6, 3.0 * rows))
    _distributions(top.subplots(), flights, vehicle)
    small = bottom.subplots(2 * rows, COLUMNS, squeeze=False)
    for axis in small.flat[2 * rows * COLUMNS - 1 :: -1]:
        axis.set_visible(False)
    for k, (name, values) in enumerate(flights.drawn.items()):
        row, column = divmod(k, COLUMNS)
        upper, lower = small[2 * row, column], small[2 * row + 1, column]
        bins = sliced(values, flights.failed, flights.error)
        _completed(upper, bins)
        _errors(lower, bins, values, flights)
        lower.set_xlabel(name)
        for axis in (upper, lower):
            axis.set_visible(True)
            axis.set_xlim(values.min(), max(values.max(), values.min() + 1e-9))
        if column == 0:
            upper.set_ylabel("completed [%]")
            lower.set_ylabel("position RMS [m]")
    return figure


def _distributions(axis: Axes, flights: Flown, vehicle: str) -> None:
    logs = [np.log10(np.maximum(c[np.isfinite(c)], LEAST)) for c in flights.rms.T]
    shown = [k for k, column in enumerate(logs) if column.size]
    if shown:
        axis.violinplot([logs[k] for k in shown], [k + 1 for k in shown], showmedians=True)
        low, high = min(logs[k].min() for k in shown), max(logs[k].max() for k in shown)
        ticks = range(int(np.floor(low)), int(np.ceil(high)) + 1)
        axis.set(yticks=list(ticks), yticklabels=[f"{10.0**k:g}" for k in ticks])
    axis.set(xticks=range(1, len(logs) + 1), xticklabels=flights.names, ylabel="RMS [m, deg]")
    text = f"{vehicle}: {len(flights)} random flights, {flights.failed.sum()} not completed"
    axis.set_title(text, loc="left")


def _steps(bins: list[Bin]) -> np.ndarray:
    return np.array([edge for one in bins for edge in (one.low, one.high)])


def _completed(axis: Axes, bins: list[Bin]) -> None:
    """Draw the share of completed flights of each bin, with its confidence band."""
    share, low, high = (100.0 * np.repeat([b.completed[k] for b in bins], 2) for k in range(3))
    axis.fill_between(_steps(bins), low, high, color=style.FLIGHTS[0], alpha=0.25, linewidth=0)
    axis.plot(_steps(bins), share, color=style.FLIGHTS[0])
    axis.set_ylim(min(90.0, low.min() - 1.0), 100.5)


def _errors(axis: Axes, bins: list[Bin], values: np.ndarray, flights: Flown) -> None:
    """Draw median and 5 to 95 % of the error of each bin; single flights where they are few."""
    low, middle, high = (np.repeat([b.error[k] for b in bins], 2) for k in range(3))
    axis.fill_between(_steps(bins), low, high, color=style.FLIGHTS[0], alpha=0.25, linewidth=0)
    axis.plot(_steps(bins), middle, color=style.FLIGHTS[0])
    failed = np.flatnonzero(flights.failed)[:MARKED]
    if len(flights) <= MARKED:
        done = ~flights.failed
        axis.plot(values[done], flights.error[done], ".", color=style.MUTED, markersize=2)
    axis.plot(values[failed], flights.error[failed], "x", color=style.DROP, markersize=3)
    if np.isfinite(flights.error).any():
        axis.set_yscale("log")


def write(
    out: Path, results: Mapping[int, TrialResult], vehicle: str, command: str, again: str
) -> str:
    """Write campaign.json, campaign.png, summary.md and report.html; return summary.

    again: command that flies one flight again, to which `--draws NUMBER --replay` is added.
    """
    flights = Flown(results)
    shared = common(flights.drawn, flights.failed)
    slices = {n: sliced(v, flights.failed, flights.error) for n, v in flights.drawn.items()}
    worst = [_listed(flights, row, again) for row in flights.worst(WORST)]
    percentiles = {str(p): [percentile(c, p) for c in flights.rms.T] for p in PERCENTILES}
    numbers = {
        "command": command,
        "vehicle": vehicle,
        "versions": versions(),
        "flights": len(flights),
        "outcomes": flights.outcomes,
        "columns": flights.names,
        "rms_percentiles": {p: [one[0] for one in row] for p, row in percentiles.items()},
        "rms_percentiles_band": {p: [one[1:] for one in row] for p, row in percentiles.items()},
        "failures_have_in_common": shared,
        "slices": {name: [asdict(one) for one in bins] for name, bins in slices.items()},
        "worst": worst,
    }
    write_json(out / "campaign.json", numbers)
    paragraphs = [*_summary(flights, shared, vehicle), _worst_table(worst)]
    summary = "\n\n".join([*paragraphs, f"Made by `{command}`.\n"])
    write_text(out / "summary.md", summary)
    with style.styled():
        style.save(picture(flights, vehicle), out / "campaign.png")
    page = templates.render(
        "uam_lab.experiments.campaign",
        "campaign.html.j2",
        vehicle=vehicle,
        sentence=_sentence(flights, vehicle),
        names=flights.names,
        percentiles=_percentile_rows(flights),
        heads=PERCENTILES,
        picture=templates.embedded(out / "campaign.png"),
        slices=slices,
        worst=worst,
        outcomes=OUTCOMES,
        command=command,
    )
    write_text(out / "report.html", page)
    return summary


def _listed(flights: Flown, row: int, again: str) -> dict[str, Any]:
    number = int(flights.numbers[row])
    return {
        "flight": number,
        "outcome": flights.outcome[row],
        "position_rms_m": float(flights.error[row]),
        "why": flights.why[row],
        "drawn": {name: float(values[row]) for name, values in flights.drawn.items()},
        "again": f"{again} --draws {number} --replay",
    }


def _sentence(flights: Flown, vehicle: str) -> str:
    count, outcomes = len(flights), flights.outcomes
    done, low, high = (100.0 * x for x in share(outcomes[COMPLETED], count))
    others = [f"{n} {outcome}" for outcome, n in outcomes.items() if n and outcome != COMPLETED]
    return (
        f"{vehicle}: {outcomes[COMPLETED]} of {count} flights completed the mission "
        f"({done:.1f} %, 95 % band {low:.1f} to {high:.1f} %); {', '.join(others) or 'none lost'}."
    )


def _percentile_rows(flights: Flown) -> list[list[str]]:
    rows = []
    for name, column in zip(flights.names, flights.rms.T, strict=True):
        unit, digits = ("m", 3) if name in BASE_COORDINATES[POSITION] else ("deg", 2)
        found = [percentile(column, p) for p in PERCENTILES]
        rows.append([name, *(_with_band(one, digits, unit) for one in found)])
    return rows


def _with_band(found: tuple[float, float, float], digits: int, unit: str) -> str:
    """Return a percentile in words; too few flights give no upper end of the band, or nothing."""
    middle, low, high = found
    if math.isnan(middle):
        return "unknown"
    end = f"to {high:.{digits}f}" if math.isfinite(high) else "or more"
    return f"{middle:.{digits}f} {unit} ({max(low, 0.0):.{digits}f} {end})"


def _summary(
    flights: Flown, shared: Sequence[tuple[str, float, float, float]], vehicle: str
) -> Iterator[str]:
    """Yield the paragraphs; shared: see `common`."""
    yield _sentence(flights, vehicle)
    others = [o for o, n in flights.outcomes.items() if n and o != COMPLETED]
    if others:
        yield "\n".join(f"- {outcome}: {OUTCOMES[outcome]}" for outcome in others)
    head = ["RMS error", *(f"{p} % of flights below (95 % band)" for p in PERCENTILES)]
    yield templates.markdown_table(head, _percentile_rows(flights))
    if not shared:
        return
    yield "Conditions of the flights that were not completed, the largest distance first:"
    head = ["", "their mean", "mean of the others", "distance [standard deviations]"]
    rows = ([n, f"{a:.3g}", f"{b:.3g}", f"{d:+.2f}"] for n, a, b, d in shared)
    yield templates.markdown_table(head, rows)
    failed = [why for why, bad in zip(flights.why, flights.failed, strict=True) if bad]
    kinds = Counter(map(_kind, failed))
    yield "Reasons: " + "; ".join(f"{kind}: {kinds[kind]}" for kind in sorted(kinds)) + "."


def _worst_table(worst: Sequence[dict[str, Any]]) -> str:
    return templates.markdown_table(
        ["worst flights", "outcome", "position RMS [m]", "with report and video"],
        (
            [
                str(one["flight"]),
                one["outcome"],
                "unknown" if math.isnan(one["position_rms_m"]) else f"{one['position_rms_m']:.3g}",
                f"`{one['again']}`",
            ]
            for one in worst
        ),
    )


def _kind(why: str) -> str:
    """Return a reason without its numbers, so that similar ones are counted together."""
    words = [word for word in why.split(";")[0].split() if not any(c.isdigit() for c in word)]
    return " ".join(words)
