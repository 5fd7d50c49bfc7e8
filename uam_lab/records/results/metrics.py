"""Metrics of a flight (metrics.json), computed from the recorded series and the facts beside it.

Errors are truth minus reference; on a vehicle, which has no truth, estimate minus reference
(`errors_of`). RMS and maximum run over the whole flight, from the take-off
command to the touchdown command (`Series.flown`); every control tick weighs the same.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uam_control.grasp import Grasp
from uam_lab.records.results import phase_errors
from uam_lab.records.results.phase_errors import Figure, largest, of_hand, rms
from uam_lab.records.results.timeseries import SUBSYSTEMS, Series

PASSED_ON = (
    "controller",
    "vehicle",
    "profile",
    "scenario",
    "engine",
    "layout",
    "clock",
    "autopilot",
    "seed",
    "payload_mass_kg",
)

# criteria of a completed mission
AWAY = 0.05  # [m] of the payload from its start position, and above its lowest position
HELD = 0.5  # [s] minimum duration of both; a fall from the stand is shorter
PLACE = 0.15  # [m] horizontal distance of the payload from the drop point
RISEN = 0.5  # share of the reference's rise, below which the vehicle never took off
LANDING = 0.15  # [m] horizontal distance of the vehicle from the landing point
REST = 0.02  # [m/s] speed below which the payload is at rest


@dataclass(frozen=True)
class Payload:
    """Transport of the payload; None without payload or if it cannot be determined."""

    lifted: bool | None = None
    lifted_at_s: float | None = None
    lift_height_m: float | None = None
    place_error_m: float | None = None
    at_rest: bool | None = None


def compute(
    series: Series,
    info: Mapping[str, Any],
    latency_s: Sequence[float] | np.ndarray | None = None,
) -> dict[str, Any]:
    """Return the content of metrics.json.

    info: PASSED_ON, `wall_s`, `abort_reason` ("" or None without an abort); optionally
    `transitions` (of the supervisor, see `outcome.transition`), `grasps` (see
    `outcome.grasp_decision`), `faults`, `drop_point` [x, y] and
    `landing_point` [x, y] (default the take-off point) [m], `missed_ticks`.
    latency_s: sensor-to-setpoint latency per tick [s], used when `clock` is "realtime".
    """
    payload = payload_facts(series, info.get("payload_mass_kg"), info.get("drop_point"))
    landing = landing_error(series, info.get("landing_point") or takeoff_point(series))
    shortfalls = what_is_missing(
        flown=left_the_ground(series),
        landing_error_m=landing,
        abort_reason=info.get("abort_reason") or "",
        payload=payload,
        grasps=info.get("grasps") or [],
        to_carry=bool(info.get("payload_mass_kg")),
    )
    duration = _span(series.time[series.flown])
    wall = info.get("wall_s")
    simulated = _span(series.time)
    phases = phase_errors.by_phase(series)
    metrics = {key: info.get(key) for key in PASSED_ON}
    metrics |= {
        "duration_s": round(duration, 6),
        "wall_s": wall,
        "real_time_factor": simulated / wall if wall else None,
        "mission_completed": not shortfalls,
        "shortfalls": shortfalls,
        "abort_reason": info.get("abort_reason") or None,
        "transitions": info.get("transitions") or [],
        "grasp": grasp_facts(info.get("grasps") or []),
        "payload_lifted": payload.lifted,
        "payload_lifted_at_s": payload.lifted_at_s,
        "payload_lift_height_m": payload.lift_height_m,
        "payload_place_error_m": payload.place_error_m,
        "load_steps": phase_errors.load_steps(series),
        "landing_error_m": landing,
        "rms": errors(series, rms) | of_hand(series, series.flown, rms),
        "max": errors(series, largest) | of_hand(series, series.flown, largest),
        "position_3d_m": rms(phase_errors.distance(series, series.flown)),
        "phases": phases,
        "trajectory": next((p for p in phases if p["phase"] == phase_errors.TRAJECTORY), None),
        "trajectory_with_ramps": phase_errors.with_ramps(series),
        "faults": info.get("faults") or [],
    }
    if info.get("errors_of"):
        metrics["errors_of"] = info["errors_of"]
    if info.get("clock") == "realtime":
        metrics["latency_ms"] = latency_figures(latency_s)
        metrics["missed_ticks"] = info.get("missed_ticks")
    factor = thrust_factor(series)
    if factor is not None:
        metrics["thrust_factor"] = factor
    counted = clamps(series)
    if counted is not None:
        metrics["clamps"] = counted
    return plain(metrics)


def errors(series: Series, figure: Figure = rms) -> dict[str, list[float]]:
    """Return `figure` of the tracking errors over the flight, by group, in the group's unit."""
    return phase_errors.by_group(series, series.flown, figure)


def payload_facts(
    series: Series, mass: float | None, drop_point: Sequence[float] | None
) -> Payload:
    """Return whether the magnet lifted the payload, and its final position error.

    Lifted: with the magnet on, the payload was for `held_s` at least `away_m` from its start
    position and at least `away_m` above its lowest position. Height above the start is no
    criterion, because the hanging arm carries the payload lower than the stand.
    """
    spans = series.magnet_spans()
    place = series.block("payload.")[:, :3]
    if not mass or not spans or np.isnan(place).all():
        return Payload()
    start, end = series.row_at(spans[0][0]), series.row_at(spans[-1][1])
    carried, time = place[start : end + 1], series.time[start : end + 1]
    rise = float(np.max(carried[:, 2] - place[start, 2]))
    away = np.linalg.norm(carried - place[start], axis=1) >= AWAY
    above = carried[:, 2] - np.nanmin(place[:, 2]) >= AWAY
    when = _first_held(time, away & above, HELD)
    lifted = when is not None
    if drop_point is None:
        return Payload(lifted, when, rise)
    distance = float(np.hypot(*(place[-1, :2] - np.asarray(drop_point, dtype=float))))
    # mean speed over half a second, so that the turning point of a bounce is not taken for rest
    before = series.row_at(series.time[-1] - 0.5)
    elapsed = series.time[-1] - series.time[before]
    speed = float(np.linalg.norm(place[-1] - place[before])) / elapsed if elapsed > 0.0 else 0.0
    return Payload(lifted, when, rise, distance, speed <= REST)


def _first_held(time: np.ndarray, true: np.ndarray, span: float) -> float | None:
    """Return the start [s] of the first interval of `true` (ticks,) of at least `span` [s]."""
    edges = np.flatnonzero(np.diff(true.astype(np.int8), prepend=0, append=0))
    for begin, end in zip(edges[::2], edges[1::2] - 1, strict=True):
        if time[end] - time[begin] >= span:
            return float(time[begin])
    return None


def takeoff_point(series: Series) -> tuple[float, float]:
    """Return x, y [m, world] of the reference at the take-off command; 0, 0 without a take-off."""
    if not series.flown.any():
        return 0.0, 0.0
    row = int(np.argmax(series.flown))
    return float(series["reference.x"][row]), float(series["reference.y"][row])


def left_the_ground(series: Series) -> bool:
    """Return whether the vehicle has risen, by RISEN of the rise of its reference.

    Without a true height (a real vehicle) the flown phases count.
    """
    if not series.flown.any():
        return False
    true, desired = (series[name][series.flown] for name in ("truth.z", "reference.z"))
    if not np.isfinite(true).all():
        return True
    return float(np.ptp(true)) >= RISEN * float(np.nanmax(desired) - desired[0])


def landing_error(series: Series, point: Sequence[float]) -> float | None:
    """Return the horizontal distance [m] of the vehicle to `point` at the end; None if not landed.

    point: x, y [m, world].
    """
    if not series.in_phase("landed").any():
        return None
    return float(np.hypot(series["truth.x"][-1] - point[0], series["truth.y"][-1] - point[1]))


def what_is_missing(
    flown: bool,
    landing_error_m: float | None,
    abort_reason: str,
    payload: Payload,
    grasps: Sequence[Mapping[str, Any]] = (),
    to_carry: bool = False,
) -> list[str]:
    """Return the unmet criteria of a completed mission, one line each.

    landing_error_m: None if it has not landed; to_carry: whether there is a payload.
    """
    if abort_reason:
        return [f"aborted: {abort_reason}"]
    if not flown:
        return ["never took off"]
    missing = []
    if landing_error_m is None:
        missing.append("not landed")
    elif not landing_error_m <= LANDING:
        missing.append(f"landed {landing_error_m:.2f} m from the landing point")
    if left_behind(grasps, to_carry) and not payload.lifted:
        missing.append(f"payload {grasps[-1]['text']}")
    elif payload.lifted is False:
        missing.append(f"payload not lifted (rose {payload.lift_height_m:.3f} m)")
    elif payload.place_error_m is not None:
        if not payload.place_error_m <= PLACE:
            missing.append(f"payload {payload.place_error_m:.2f} m from the drop point")
        elif not payload.at_rest:
            missing.append("payload still moving at the end")
    return missing


def left_behind(grasps: Sequence[Mapping[str, Any]], to_carry: bool) -> bool:
    """Return whether a payload was left where it is: given up, or absent although it is `to_carry`.

    grasps: see `outcome`. A flight without payload finds none, as it should.
    """
    state = grasp_facts(grasps)["state"]
    return state == Grasp.GIVEN_UP.value or (to_carry and state == Grasp.ABSENT.value)


def grasp_facts(grasps: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return last state, number of approaches and decisions of the grasps; see `outcome`."""
    return {
        "state": grasps[-1]["grasp"] if grasps else "",
        "approaches": max((one["attempt"] for one in grasps), default=0),
        "decisions": list(grasps),
    }


def latency_figures(latency_s: Sequence[float] | np.ndarray | None) -> dict[str, float | None]:
    """Return percentiles and maximum [ms] of latencies (ticks,) [s]."""
    if latency_s is None or not len(latency_s):
        return {"p50": None, "p99": None, "max": None}
    milliseconds = 1e3 * np.asarray(latency_s, dtype=float)
    p50, p99 = np.percentile(milliseconds, [50.0, 99.0])
    return {"p50": float(p50), "p99": float(p99), "max": float(np.max(milliseconds))}


def thrust_factor(series: Series) -> dict[str, float] | None:
    """Return identified true / assumed thrust: at the end, and its range; None if unknown."""
    factor = series["thrust.factor"][series.flown]
    factor = factor[np.isfinite(factor)]
    if not len(factor):
        return None
    return {"end": factor[-1], "least": np.min(factor), "largest": np.max(factor)}


def clamps(series: Series) -> dict[str, int] | None:
    """Return the number of clamped errors per subsystem; None for laws without clamping."""
    counts = {s: series[f"adaptation.{s}.clamps"] for s in SUBSYSTEMS}
    if not any(np.isfinite(count).any() for count in counts.values()):
        return None
    return {s: int(np.nanmax(count, initial=0.0)) for s, count in counts.items()}


def _span(times: np.ndarray) -> float:
    return float(times[-1] - times[0]) if len(times) else 0.0


def plain(value: Any) -> Any:
    """Return `value` with JSON types only: no numpy types, null instead of NaN and infinity."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
