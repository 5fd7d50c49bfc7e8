"""Result of a flight as texts and rows, for the page and the console."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from uam_control.supervision import ORDINARY
from uam_lab.report.facts import paper


@dataclass(frozen=True)
class ErrorRow:
    """One coordinate: RMS of this flight, the paper's, the largest error; None where unknown."""

    group: str
    name: str
    unit: str
    digits: int
    rms: float | None
    paper: float | None
    largest: float | None
    compared: bool = True  # with the paper's

    @property
    def better(self) -> bool | None:
        """Return whether the RMS is at most the paper's, None without a comparison."""
        known = self.compared and self.rms is not None and self.paper is not None
        return self.rms <= self.paper if known else None

    def shown(self, value: float | None) -> str:
        """Return `value` with the unit and the digits of this row."""
        if value is None:
            return "–"
        gap = "" if self.unit == "°" else " "
        return f"{value:.{self.digits}f}{gap}{self.unit}"


def not_compared(metrics: Mapping[str, Any]) -> str:
    """Return why the errors are not compared with the paper's, "" if they are."""
    if not metrics["mission_completed"]:
        return "The flight was not completed: its errors are not compared with those of the paper."
    if metrics.get("scenario") != paper.SCENARIO:
        return (
            "The paper flew another mission: the errors are not compared with those of the paper."
        )
    return ""


def error_rows(metrics: Mapping[str, Any]) -> list[ErrorRow]:
    rows = []
    for group, heading, unit, digits, names in paper.tables(len(metrics["rms"]["arm_deg"])):
        columns = zip(
            names,
            metrics["rms"][group],
            paper.published(group, len(names)),
            metrics["max"][group],
            strict=True,
        )
        rows += [
            ErrorRow(heading, name, unit, digits, *figures, not not_compared(metrics))
            for name, *figures in columns
        ]
    return rows


PHASE_HEADINGS = (
    *("phase", "time [s]", "position [mm]", "largest [mm]", "attitude [°]"),
    *("arm [°]", "tilt [°]", "thrust [N]"),
)


@dataclass(frozen=True)
class PhaseRow:
    """One phase: its texts, one per PHASE_HEADINGS; whole: the trajectory's own phase."""

    texts: tuple[str, ...]
    whole: bool


def phase_rows(metrics: Mapping[str, Any]) -> list[PhaseRow]:
    """Return one row per phase. position: root mean square of the distance to the reference, 3-D;
    attitude, arm: of the norm of their errors; tilt, thrust: largest."""
    rows = []
    for one in metrics.get("phases") or []:
        attitude, arm = (_norm(one["rms"][key]) for key in ("attitude_deg", "arm_deg"))
        texts = (
            one["phase"],
            f"{one['seconds']:.1f}",
            _number(one["position_3d_m"], 1e3, 1),
            _number(one["largest_3d_m"], 1e3, 1),
            _number(attitude, 1.0, 2),
            _number(arm, 1.0, 2),
            _number(one["tilt_deg"], 1.0, 1),
            _number(one["thrust_n"], 1.0, 1),
        )
        rows.append(PhaseRow(texts, one["phase"] == "trajectory"))
    return rows


def _norm(values: Sequence[float | None]) -> float | None:
    return None if None in values else math.hypot(*values)


def _number(value: float | None, factor: float, digits: int) -> str:
    return "–" if value is None else f"{factor * value:.{digits}f}"


def verdict(metrics: Mapping[str, Any]) -> str:
    """Return the headline."""
    if metrics["mission_completed"]:
        return "Mission completed"
    return "Mission aborted" if metrics.get("abort_reason") else "Mission not completed"


def payload_story(metrics: Mapping[str, Any]) -> str:
    """Return the result of the payload's transport, in one line."""
    if metrics.get("payload_lifted") is None:
        if not metrics.get("payload_mass_kg"):
            return "no payload in this flight"
        decisions = (metrics.get("grasp") or {}).get("decisions")
        return decisions[-1]["text"] if decisions else "the magnet was never on"
    if not metrics["payload_lifted"]:
        return "not lifted"
    error = metrics.get("payload_place_error_m")
    rest = "" if error is None else f", came to rest {distance(error)} from the drop point"
    return f"lifted{rest}{_load_steps(metrics)}"


def _load_steps(metrics: Mapping[str, Any]) -> str:
    """Return how far the vehicle was from its reference while the load changed, in a clause."""
    texts = [
        f"{_number(one['epsilon_m'], 1e3, 0)} mm (rho {_number(one['rho'], 1.0, 2)})"
        f" at the {name.replace('_', '-')}"
        for name, one in (metrics.get("load_steps") or {}).items()
        if one
    ]
    return f"; the vehicle off its path by at most {', '.join(texts)}" if texts else ""


def landing_story(metrics: Mapping[str, Any]) -> str:
    """Return the landing error, in one line."""
    error = metrics.get("landing_error_m")
    return "not landed" if error is None else f"{distance(error)} from the landing point"


def hand_story(metrics: Mapping[str, Any]) -> str | None:
    """Return the error of the end effector, of the trajectory with its ramps if there is one, in
    one line; None without an end effector."""
    of = metrics.get("trajectory_with_ramps") or metrics
    if "end_effector_norm_m" not in of["rms"]:
        return None
    rms, most = (of[key]["end_effector_norm_m"] for key in ("rms", "max"))
    when = "on the trajectory with its ramps" if of is not metrics else "in flight"
    heading = of["rms"]["end_effector_heading_deg"]
    text = f"{_number(rms, 1e3, 1)} mm RMS, {_number(most, 1e3, 1)} mm at most"
    return f"{text}, heading {_number(heading, 1.0, 2)}° RMS, {when}"


def supervision_story(metrics: Mapping[str, Any]) -> str | None:
    """Return the interventions of the supervisor, in one line; None without any."""
    steps = [
        f"{one['to']} at {one['time_s']:.1f} s ({one['cause']})"
        for one in metrics.get("transitions") or []
        if one["cause"] not in ORDINARY.values()
    ]
    return ", ".join(steps) or None


def clamp_story(metrics: Mapping[str, Any]) -> str:
    """Return the number of clamped errors per subsystem (ASMC-2), in one line."""
    return ", ".join(f"{subsystem} {count}" for subsystem, count in metrics["clamps"].items())


def thrust_story(metrics: Mapping[str, Any]) -> str | None:
    """Return the ratio of true to assumed thrust, as identified in flight, in one line."""
    found = metrics.get("thrust_factor")
    if found is None:
        return None
    return (
        f"{found['end']:.3f} of the assumed thrust at the end"
        f" ({found['least']:.3f} to {found['largest']:.3f} in flight)"
    )


def distance(metres: float) -> str:
    """Return a distance in m, or in cm if it is below 1 m."""
    return f"{metres:.2f} m" if metres >= 1.0 else f"{100.0 * metres:.1f} cm"
