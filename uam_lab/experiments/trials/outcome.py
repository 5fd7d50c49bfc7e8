"""Outcome of a flight: one of five classes, and why."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from uam_control.mission.mission_output import LAND
from uam_control.supervision import State
from uam_lab.records.results.timeseries import Series
from uam_sim_bridge.plant.plant import BROKEN

COMPLETED, HELD, LANDED, FAILSAFE, LOST = "completed", "held", "landed", "failsafe", "lost"
REFUSED = "refused"
OUTCOMES = {
    REFUSED: "the start was refused, nothing was armed (rehearsals only)",
    COMPLETED: "the mission was completed in spite of the fault",
    HELD: "in the air at the end, upright and at rest",
    LANDED: "the mission landed the vehicle softly, but was not completed",
    FAILSAFE: "the vehicle came down softly, but not by the mission's landing",
    LOST: "any other end: a fall, a hard landing, out of control, or an unstable plant",
}


class Ended:
    """What has an `outcome`, one of OUTCOMES."""

    outcome: str

    @property
    def completed(self) -> bool:
        return self.outcome == COMPLETED

    @property
    def lost(self) -> bool:
        """Whether the vehicle fell, landed hard or was out of control."""
        return self.outcome == LOST


def counts(outcomes: Iterable[str]) -> dict[str, int]:
    """Return the number of each outcome, in the order of OUTCOMES."""
    counted = Counter(outcomes)
    return {outcome: counted[outcome] for outcome in OUTCOMES}


# limits of the classes: soft, upright, on the ground, at rest
IMPACT = 1.0  # [m/s] downward speed near the ground
TILT = 0.35  # [rad] at the end
HEIGHT = 0.08  # [m] above the start, at the end, for on the ground
NEAR_GROUND = 0.15  # [m] above the start; the impact is searched below it
REST = 0.3  # [m/s] at the end


@dataclass(frozen=True)
class Ending:
    """The end of a flight."""

    height: float  # [m] above the start
    tilt: float  # [rad]
    speed: float  # [m/s]
    impact: float  # [m/s]
    largest_tilt: float  # [rad] of the flight


def ending(series: Series) -> Ending:
    """Return the true state at the end; series: with at least one tick."""
    height = series["truth.z"] - series["truth.z"][0]
    velocity = np.column_stack([series[f"truth.{axis}_dot"] for axis in "xyz"])
    tilts = series.tilt
    low = height < NEAR_GROUND
    return Ending(
        height=float(height[-1]),
        tilt=float(tilts[-1]),
        speed=float(np.linalg.norm(velocity[-1])),
        impact=float(max(0.0, np.max(-velocity[low, 2]))) if low.any() else 0.0,
        largest_tilt=float(np.nanmax(tilts)),
    )


# why a flight that fulfils the criteria of its mission is no completed one
TOUCHED = "reached the ground in flight, while its reference was above it"


def classify(series: Series, figures: Mapping[str, Any]) -> str:
    """Return one of OUTCOMES; figures: metrics.json of the flight."""
    if (figures.get("abort_reason") or "").startswith(BROKEN):
        return LOST  # what came after is not known
    if figures["mission_completed"]:  # except after a landing by the autopilot's failsafe
        return FAILSAFE if _down_early(series) else COMPLETED
    end = ending(series)
    upright = end.tilt <= TILT and end.speed <= REST
    if upright and end.height > HEIGHT:
        return HELD
    if upright and end.impact <= IMPACT:
        left = any(one["to"] == State.FAILSAFE.value for one in figures.get("transitions", ()))
        commanded = series.in_phase("landed").any() and not _down_early(series)
        return LANDED if commanded and not left else FAILSAFE
    return LOST


def explained(outcome: str, figures: Mapping[str, Any]) -> str:
    """Return why a flight counts as `outcome`, one of OUTCOMES; figures: metrics.json of it."""
    if figures["mission_completed"] and outcome == FAILSAFE:
        return TOUCHED
    return "; ".join(figures["shortfalls"])


def down_after(series: Series, begun: float) -> float | None:
    """Return the time [s] from mission time `begun` [s] to final touchdown; None: in the air."""
    up = np.flatnonzero(series["truth.z"] - series["truth.z"][0] > HEIGHT)
    if not up.size:
        return 0.0
    if up[-1] == len(series) - 1:
        return None
    return max(0.0, float(series.time[up[-1]]) - begun)


def _down_early(series: Series) -> bool:
    """Return whether the vehicle reached the ground in flight while the desired height was up.

    In a landing the desired height counts from the estimate: the frame of an odometry drifts.
    """
    height = series["truth.z"] - series["truth.z"][0]
    desired = series["reference.z"] - series["truth.z"][0]
    been_up = np.maximum.accumulate(height) > NEAR_GROUND
    down = been_up & (height < HEIGHT) & series.flown
    if not down.any():
        return False
    first = np.argmax(down)
    if series.in_phase(LAND)[first]:
        desired = desired + series["truth.z"] - series["estimate.z"]
    return bool(desired[first] > NEAR_GROUND)
