"""Outcome of a flight with a fault, one of five classes, and the promise of a matrix about it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from uam_control.settings.names import unknown
from uam_control.supervision import State
from uam_lab.records.results.timeseries import Series
from uam_sim_bridge.faults import FaultError

COMPLETED, HELD, LANDED, FAILSAFE, LOST = "completed", "held", "landed", "failsafe", "lost"
REFUSED = "refused"
OUTCOMES = {
    REFUSED: "the start was refused, nothing was armed (rehearsals only)",
    COMPLETED: "the mission was completed in spite of the fault",
    HELD: "in the air at the end, upright and at rest",
    LANDED: "the mission landed the vehicle softly, but was not completed",
    FAILSAFE: "the vehicle came down softly, but not by the mission's landing",
    LOST: "any other end: a fall, a hard landing, or out of control",
}


def counts(outcomes: Iterable[str]) -> dict[str, int]:
    """Return the number of each outcome, in the order of OUTCOMES."""
    counted = Counter(outcomes)
    return {outcome: counted[outcome] for outcome in OUTCOMES}


@dataclass(frozen=True)
class OutcomeLimits:
    """Limits of the classes: soft, upright, on the ground, at rest."""

    impact: float = 1.0  # [m/s] downward speed near the ground
    tilt: float = 0.35  # [rad] at the end
    height: float = 0.08  # [m] above the start, at the end, for on the ground
    near_ground: float = 0.15  # [m] above the start; the impact is searched below it
    rest: float = 0.3  # [m/s] at the end


@dataclass(frozen=True)
class Ending:
    """The end of a flight: height above the start [m], tilt [rad], speed [m/s], impact [m/s], and
    the largest tilt of the flight [rad]."""

    height: float
    tilt: float
    speed: float
    impact: float
    largest_tilt: float


def ending(series: Series, limits: OutcomeLimits | None = None) -> Ending:
    """Return the true state at the end; series: with at least one tick."""
    limits = limits or OutcomeLimits()
    height = series["truth.z"] - series["truth.z"][0]
    velocity = np.column_stack([series[f"truth.{axis}_dot"] for axis in "xyz"])
    tilts = series.tilt
    low = height < limits.near_ground
    return Ending(
        height=float(height[-1]),
        tilt=float(tilts[-1]),
        speed=float(np.linalg.norm(velocity[-1])),
        impact=float(max(0.0, np.max(-velocity[low, 2]))) if low.any() else 0.0,
        largest_tilt=float(np.nanmax(tilts)),
    )


# why a flight that fulfils the criteria of its mission is no completed one
TOUCHED = "reached the ground in flight, while its reference was above it"


def classify(
    series: Series, figures: Mapping[str, Any], limits: OutcomeLimits | None = None
) -> str:
    """Return one of OUTCOMES; figures: metrics.json of the flight."""
    limits = limits or OutcomeLimits()
    if figures["mission_completed"]:  # except after a landing by the autopilot's failsafe
        return FAILSAFE if _down_early(series, limits) else COMPLETED
    end = ending(series, limits)
    upright = end.tilt <= limits.tilt and end.speed <= limits.rest
    if upright and end.height > limits.height:
        return HELD
    if upright and end.impact <= limits.impact:
        left = any(one["to"] == State.FAILSAFE.value for one in figures.get("transitions", ()))
        commanded = series.in_phase("landed").any() and not _down_early(series, limits)
        return LANDED if commanded and not left else FAILSAFE
    return LOST


def explained(outcome: str, figures: Mapping[str, Any]) -> str:
    """Return why a flight counts as `outcome`, one of OUTCOMES; figures: metrics.json of it."""
    if figures["mission_completed"] and outcome == FAILSAFE:
        return TOUCHED
    return "; ".join(figures["shortfalls"])


def down_after(series: Series, begun: float, limits: OutcomeLimits | None = None) -> float | None:
    """Return the time [s] from mission time `begun` [s] to final touchdown; None: in the air."""
    limits = limits or OutcomeLimits()
    up = np.flatnonzero(series["truth.z"] - series["truth.z"][0] > limits.height)
    if not up.size:
        return 0.0
    if up[-1] == len(series) - 1:
        return None
    return max(0.0, float(series.time[up[-1]]) - begun)


def _down_early(series: Series, limits: OutcomeLimits) -> bool:
    """Return whether the vehicle reached the ground in flight while the desired height was up."""
    height = series["truth.z"] - series["truth.z"][0]
    desired = series["reference.z"] - series["truth.z"][0]
    been_up = np.maximum.accumulate(height) > limits.near_ground
    down = been_up & (height < limits.height) & series.flown
    return bool(down.any()) and bool(desired[np.argmax(down)] > limits.near_ground)


@dataclass(frozen=True)
class Promise:
    """outcomes: the allowed ones of OUTCOMES; within [s]: longest time from the fault to the final
    touchdown, if the mission is not completed; because: part of the reason."""

    outcomes: tuple[str, ...]
    within: float = math.inf
    because: str = ""

    def kept(self, outcome: str, down_after: float | None, why: str) -> bool:
        """Return whether a flight kept the promise.

        down_after [s]: None without touchdown; why: the reason of the end.
        """
        soon = down_after is None or down_after <= self.within
        return outcome in self.outcomes and soon and self.because in why


def read_promise(given: Any, where: str) -> Promise:
    """Read an entry `promise` of a matrix: {outcome: one or a list, within: 8, because: text}.

    Raises FaultError.
    """
    entries = ("outcome", "within", "because")
    for key in given if isinstance(given, Mapping) else ():
        if key not in entries:
            raise FaultError(f"{where}: promise: {key}: {unknown(key, entries)}")
    if not isinstance(given, Mapping) or "outcome" not in given:
        raise FaultError(
            f"{where}: promise: {{outcome: ..., within: seconds, because: text}} expected"
        )
    named = given["outcome"]
    outcomes = tuple(named) if isinstance(named, list) else (named,)
    for one in outcomes:
        if not isinstance(one, str) or one not in OUTCOMES:
            raise FaultError(
                f"{where}: promise: unknown outcome '{one}'; there are: {', '.join(OUTCOMES)}"
            )
    within = given.get("within", math.inf)
    if isinstance(within, bool) or not isinstance(within, int | float) or not within > 0.0:
        raise FaultError(f"{where}: promise: within: {within!r} is not a time above 0 s")
    because = given.get("because", "")
    if not isinstance(because, str):
        raise FaultError(f"{where}: promise: because: {because!r} is not a text")
    return Promise(outcomes, float(within), because)
