"""The table of a design: each loop's bandwidth, its least margins, and what limits it."""

from __future__ import annotations

import math
from collections.abc import Iterator

from uam_lab.experiments.design.search import RATES, Design
from uam_lab.records.results.templates import markdown_table

HEAD = ("loop", "crossover rad/s", "phase deg", "gain dB", "delay ms", "peak", "limited by")


def text(made: Design) -> str:
    """Return the table in Markdown, the least margins over all operating points of the design."""
    found = [case.analysis for case in made.cases]
    delay = 1e3 * min(one.setpoint_delay for one in found)
    name, labels = made.described.name, ", ".join(case.label for case in made.cases)
    return "\n\n".join(
        [
            f"{name}, hover, linear; least margins of: {labels}",
            markdown_table(HEAD, _rows(made)),
            f"setpoints may come {delay:.0f} ms later",
        ]
    )


def _rows(made: Design) -> Iterator[list[str]]:
    for loop in made.cases[0].analysis.loops:
        seen = [case.analysis.loops[loop][1] for case in made.cases]
        yield [
            loop,
            f"{min(one.crossover for one in seen):.3g}",
            f"{min(abs(one.phase) for one in seen):.0f}",
            _finite(min(min(one.gain, one.gain_down) for one in seen), 1),
            _finite(1e3 * min(one.delay for one in seen), 0),
            f"{max(one.peak for one in seen):.2f}",
            made.limits[loop],
        ]
    if RATES in made.limits:
        yield [RATES, "", "", "", "", "", made.limits[RATES]]


def _finite(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "-"
