"""Tables of the flights beside the paper's row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from table1_flights.flights import Row
from uam_lab.report.facts import paper

COLUMNS = ("x [m]", "y [m]", "z [m]", "roll [°]", "pitch [°]", "yaw [°]", "α₁ [°]", "α₂ [°]")
DIGITS = (3, 3, 3, 2, 2, 2, 2, 2)
FACTOR = 2.0
PUBLISHED = np.concatenate([paper.RMS[group] for group, *_ in paper.tables(2)])


@dataclass(frozen=True)
class Flown:
    """Results of a row: rms (seeds, 8) [m, deg] and outcome of each flight."""

    row: Row
    rms: np.ndarray
    outcomes: tuple[str, ...]

    @property
    def mean(self) -> np.ndarray:
        """Root mean square over the seeds (8,)."""
        return np.sqrt(np.mean(np.square(self.rms), axis=0))

    @property
    def ratios(self) -> np.ndarray:
        """RMS here / RMS in the paper (8,)."""
        return self.mean / PUBLISHED

    @property
    def close(self) -> int:
        """Number of columns within a factor of two of the paper's."""
        return int(np.sum((self.ratios <= FACTOR) & (self.ratios >= 1.0 / FACTOR)))

    @property
    def distance(self) -> float:
        """Mean of |log2 ratio| over the columns: 1 is a factor of two."""
        return float(np.mean(np.abs(np.log2(self.ratios))))

    @property
    def completed(self) -> str:
        """Completed flights of all."""
        return f"{self.outcomes.count('completed')} of {len(self.outcomes)}"


def beside_the_paper(flown: Sequence[tuple[str, Flown]]) -> str:
    """Return the table with the paper's row, and below each row its ratio to the paper's."""
    lines = [*_head("row", "in factor 2", "completed"), _line("the paper", PUBLISHED, "", "")]
    for label, one in flown:
        lines.append(_line(label, one.mean, f"{one.close} of 8", one.completed))
        cells = [f"× {ratio:.2f}" for ratio in one.ratios]
        lines.append(f"| | {' | '.join(cells)} | | |")
    return "\n".join(lines)


def one_by_one(flown: Sequence[Flown]) -> str:
    """Return the table of the rows with one assumption changed each."""
    lines = _head("assumption", "reading", "in factor 2", "completed", at=2)
    group = None
    for one in flown:
        shown = one.row.group if one.row.group != group else ""
        group = one.row.group
        first = f"{shown} | {one.row.label}"
        lines.append(_line(first, one.mean, f"{one.close} of 8", one.completed))
    return "\n".join(lines)


def best(flown: Sequence[Flown], count: int) -> str:
    """Return the table of the `count` nearest rows, the nearest first."""
    ranked = sorted(flown, key=lambda one: (-one.close, one.distance))
    return beside_the_paper([(one.row.label, one) for one in ranked[:count]])


def _head(*texts: str, at: int = 1) -> list[str]:
    names = (*texts[:at], *COLUMNS, *texts[at:])
    return [f"| {' | '.join(names)} |", "|---" * len(names) + "|"]


def _line(first: str, values: np.ndarray, *last: str) -> str:
    cells = [f"{value:.{digits}f}" for value, digits in zip(values, DIGITS, strict=True)]
    return f"| {' | '.join((first, *cells, *last))} |"
