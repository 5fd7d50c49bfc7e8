"""The entry `trajectory` of a scenario file: closed curves, or minimum snap through waypoints.

For given times the curve of least integral of the squared snap consists of polynomials of degree 7,
with derivatives up to the sixth continuous at the inner points (Mellinger and Kumar 2011): a spline
whose rate, acceleration and jerk are zero at both ends.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from uam_control.coordinates import ALPHA, ARM, CHI_DOT, POSITION, YAW, Z, arm_coordinates
from uam_control.mission.motion.polynomials import Polynomials
from uam_control.mission.scenarios import curves
from uam_control.mission.scenarios.curves import Harmonic
from uam_control.mission.scenarios.fitted_spline import DEGREE, of_spline
from uam_control.mission.scenarios.route import RUN_OUT, RUN_UP, TRAJECTORY, Leg
from uam_control.mission.scenarios.scenario import check_length
from uam_control.settings.section import Section

TANGENT = "tangent"
DEFAULT_RAMP, RAMP_ACCELERATION = 3.0, 2.0  # [s] shortest, [m/s^2] largest of the default
SMOOTHSTEP = 35.0 / 16.0  # largest slope of the ramp of the speed, times its mean slope
TIMINGS = ("period", "speed", "mean_speed", "duration")
CURVE_KEYS = (
    *("kind", "height", "centre", "rotate_deg", "clockwise", "rise", "laps", "ramp", "sweep"),
    *("yaw", "yaw_deg", "yaw_turns", "arm_deg", "at", *TIMINGS),
)
SHAPES = {"circle": ("radius",), "ellipse": ("size",), "lemniscate": ("size",)}
WAYPOINT_KEYS = ("kind", "points", "times", "speed", "duration", "laps", "yaw_deg", "arm_deg", "at")
KINDS = (*SHAPES, "waypoints")
MOST = 10_000  # laps, points of all laps, cycles of a joint in all: what memory is made for
END_SHARE = 2.0  # the mean speed from rest is half of the speed reached
AT_REST = 1, 2, 3  # derivatives that are zero at both ends


@dataclass(frozen=True)
class Middle:
    """Pose about which a trajectory is flown."""

    chi: np.ndarray  # (6 + n,), angles of the arm included
    joints: tuple[tuple[float, float], ...]  # ranges (low, high) [rad]


def keys_of(kind: str) -> tuple[str, ...]:
    """Return the entries that a trajectory of a kind may have."""
    return WAYPOINT_KEYS if kind == "waypoints" else (*CURVE_KEYS, *SHAPES[kind])


def legs(entry: Section, middle: Middle) -> tuple[Leg, ...]:
    """Return the trajectory of the entry, from rest to rest. Raises the section's error."""
    kind = entry.one_of("kind", KINDS)
    entry.only(keys_of(kind))
    pose = middle.chi.copy()
    if "arm_deg" in entry.values:
        pose[ARM] = np.radians(entry.numbers("arm_deg", len(middle.joints)))
        _check_joints(entry, "arm_deg", pose[ARM], pose[ARM], middle)
    if "yaw_deg" in entry.values:
        pose[YAW] = math.radians(entry.number("yaw_deg"))
    middle = replace(middle, chi=pose)
    return _waypoints(entry, middle) if kind == "waypoints" else _curve(entry, kind, middle)


def _curve(entry: Section, kind: str, middle: Middle) -> tuple[Leg, ...]:
    shape, pose = _shape(entry, kind), middle.chi
    pose[Z] = entry.positive("height") if "at" not in entry.values else 1.0
    pose[:Z] = entry.numbers("centre", 2, default=(0.0, 0.0))
    if "rise" in entry.values:
        shape += curves.rise(entry.number("rise"))
        pose[Z] += entry.number("rise") / 2.0
    shape += _sweeps(entry, middle)
    tangent = entry.values.get("yaw") == TANGENT
    if "yaw" in entry.values and not tangent:
        raise entry.error("yaw", f"{entry.values['yaw']!r}, allowed: {TANGENT}; or yaw_deg")
    laps = _laps(entry)
    per_lap = entry.number("yaw_turns") / laps if "yaw_turns" in entry.values else 0.0
    if tangent and {"yaw_deg", "yaw_turns"} & entry.values.keys():
        raise entry.error("yaw", "tangent, and yaw_deg or yaw_turns: only one is possible")
    theta, ramp = _timing(entry, shape, laps)
    path = curves.follow(shape, theta, pose, tangent, per_lap)
    if ramp == 0.0:
        return (Leg(TRAJECTORY, path),)
    return cut(path, ramp)


def cut(path: Polynomials, ramp: float) -> tuple[Leg, ...]:
    """Return the ramps of `ramp` [s] at both ends of the path, and the part at speed."""
    knots = path.knots
    ends = [int(np.argmin(np.abs(knots - t))) for t in (ramp, knots[-1] - ramp)]
    parts = zip((0, *ends), (*ends, len(knots) - 1), strict=True)
    return tuple(
        Leg(name, Polynomials(knots[a : b + 1] - knots[a], path.coefficients[a:b]))
        for name, (a, b) in zip((RUN_UP, TRAJECTORY, RUN_OUT), parts, strict=True)
        if b > a
    )


def _laps(entry: Section, points: int = 1) -> float:
    """Return `laps`, 1 without; points: of one lap."""
    laps = entry.positive("laps", default=1.0)
    if laps * points > MOST:
        raise entry.error("laps", f"{laps:g}: at most {MOST // points} are possible")
    return laps


def _shape(entry: Section, kind: str) -> tuple[Harmonic, ...]:
    """Return the harmonics of x and y: the shape, mirrored if clockwise, then rotated."""
    if kind == "circle":
        shape = curves.circle(entry.positive("radius"))
    else:
        size = entry.numbers("size", 2)
        if min(size) <= 0.0:
            raise entry.error("size", f"{list(size)}: both must be above 0")
        shape = getattr(curves, kind)(*size)
    if "clockwise" in entry.values and entry.switch("clockwise"):
        shape = tuple(replace(h, amplitude=-h.amplitude) if h.column else h for h in shape)
    angle = math.radians(entry.number("rotate_deg")) if "rotate_deg" in entry.values else 0.0
    if not angle:
        return shape
    cosine, sine = math.cos(angle), math.sin(angle)
    rotation = ((cosine, sine), (-sine, cosine))  # rows: of x, of y
    return tuple(
        replace(h, column=column, amplitude=h.amplitude * rotation[h.column][column])
        for h in shape
        for column in (0, 1)
    )


def _sweeps(entry: Section, middle: Middle) -> tuple[Harmonic, ...]:
    """Return the harmonics of the joints: `cycles` per lap about the angle of the arm."""
    names, found = arm_coordinates(len(middle.joints)), []
    for one in entry.entries("sweep", True):
        one.only(("joint", "amplitude_deg", "cycles"))
        i = names.index(one.one_of("joint", names))
        amplitude = math.radians(one.number("amplitude_deg"))
        angles = middle.chi[ARM].copy()
        low, high = angles.copy(), angles.copy()
        low[i], high[i] = angles[i] - abs(amplitude), angles[i] + abs(amplitude)
        _check_joints(one, "amplitude_deg", low, high, middle)
        cycles, most = one.positive("cycles"), MOST / _laps(entry)
        if cycles > most:
            raise one.error("cycles", f"{cycles:g}: at most {most:g} per lap are possible")
        found.append(Harmonic(ALPHA + i, amplitude, cycles))
    return tuple(found)


def _check_joints(
    entry: Section, key: str, low: np.ndarray, high: np.ndarray, middle: Middle
) -> None:
    for i, (least, most) in enumerate(middle.joints):
        if not (least <= low[i] and high[i] <= most):
            raise entry.error(
                key,
                f"alpha_{i + 1} from {math.degrees(low[i]):g} to {math.degrees(high[i]):g}, "
                f"allowed {math.degrees(least):g} to {math.degrees(most):g}",
            )


def _timing(entry: Section, shape: tuple[Harmonic, ...], laps: float) -> tuple[Polynomials, float]:
    """Return theta over time and the length of its ramps [s]; 0: one sweep from rest to rest."""
    given = [key for key in TIMINGS if key in entry.values]
    if len(given) != 1:
        raise entry.error(given[-1] if given else "period", f"exactly one of {', '.join(TIMINGS)}")
    if given[0] == "duration":
        if "ramp" in entry.values:
            raise entry.error("ramp", "only with period or speed; duration is from rest to rest")
        check_length(entry.positive("duration"), entry.where)
        return curves.swept(laps, entry.positive("duration")), 0.0
    slope = curves.largest_slope(shape)
    if given[0] == "speed":
        period = curves.TURN * slope / entry.positive("speed")
    elif given[0] == "mean_speed":
        period = curves.lap_length(shape) / entry.positive("mean_speed")
    else:
        period = entry.positive("period")
    check_length(laps * period, entry.where)
    peak, whole = curves.TURN * slope / period, laps * period
    default = max(DEFAULT_RAMP, SMOOTHSTEP * peak / RAMP_ACCELERATION)
    # a reference that is too fast is judged as such, and can be retimed
    ramp = entry.positive("ramp", default=default if default <= whole else whole / 2.0)
    if ramp > whole:
        shorter = f"{laps:g} of {period:.3g} s are shorter than the ramps of {ramp:.3g} s"
        raise entry.error("laps", f"{shorter}: more laps, slower ones, or a shorter ramp")
    return curves.steady(laps, period, ramp), ramp


def _waypoints(entry: Section, middle: Middle) -> tuple[Leg, ...]:
    points = entry.values.get("points")
    first = points[0] if isinstance(points, list) and points else None
    width = 4 if isinstance(first, list) and len(first) == 4 else 3  # with or without yaw [deg]
    table = np.array(entry.rows("points", width))
    if len(table) < 2:
        raise entry.error("points", "two or more expected")
    laps = _laps(entry, len(table))
    if laps != round(laps):
        raise entry.error("laps", f"{laps:g}: a whole number expected")
    if laps > 1 and not np.array_equal(table[0], table[-1]):
        raise entry.error("laps", "the last point must equal the first one for several laps")
    table = np.concatenate([table, *[table[1:]] * (round(laps) - 1)])
    same = np.flatnonzero(np.linalg.norm(np.diff(table[:, :3], axis=0), axis=1) < 1e-3)
    if len(same):
        raise entry.error("points", f"points {same[0]} and {same[0] + 1} are the same")
    values = np.tile(middle.chi, (len(table), 1))
    values[:, POSITION] = table[:, :3]
    if width == 4:
        values[:, YAW] = np.radians(table[:, 3])
    return (Leg(TRAJECTORY, _timed(entry, values)),)


def _timed(entry: Section, values: np.ndarray) -> Polynomials:
    """Return the curve through values (m, 6 + n), at `times`, within `duration`, or at `speed`."""
    given = [key for key in ("times", "speed", "duration") if key in entry.values]
    if not given or "speed" in given and "duration" in given or given == ["times", "duration"]:
        raise entry.error(given[-1] if given else "speed", "one of speed, duration; or times")
    if "times" in given:
        times = np.array(entry.numbers("times", len(values)))
        if times[0] != 0.0 or (np.diff(times) <= 0.0).any():
            raise entry.error("times", "begin at 0 and increase")
    else:
        times = shares(values[:, POSITION])
    if "duration" in given:
        times = times * entry.positive("duration")
    path = minimum_snap(times, values)
    if "speed" in given:
        rates = path.rows(np.linspace(0.0, times[-1], 200 * len(values)), 2)[CHI_DOT]
        fastest = float(np.linalg.norm(rates[:, POSITION], axis=1).max())
        path = path.slowed(fastest / entry.positive("speed"))
    return path


def minimum_snap(times: np.ndarray, points: np.ndarray) -> Polynomials:
    """Return the curve through points (m, n) at times (m,) [s], increasing, m at least 2."""
    from scipy.interpolate import make_interp_spline  # takes most of a second

    at_rest = [(order, np.zeros(points.shape[1])) for order in AT_REST]
    return of_spline(make_interp_spline(times, points, DEGREE, bc_type=(at_rest, at_rest)))


def shares(points: np.ndarray) -> np.ndarray:
    """Return times (m,) from 0 to 1 for points (m, 3) [m]: in proportion to the distances' roots.

    So each piece needs about the same acceleration. In proportion to the distances themselves the
    curve swings far out between points that are not equally far apart. The first and the last piece
    have END_SHARE times as much.
    """
    widths = np.sqrt(np.linalg.norm(np.diff(points, axis=0), axis=1))
    widths[[0, -1]] *= END_SHARE
    return np.append(0.0, np.cumsum(widths)) / widths.sum()
