"""CSV trajectories, as planners write them: times and positions, and what else is known.

The columns: docs/scenarios.md. Agilicious' names p_x, q_w, v_x, a_lin_x ... mean the same; its body
rates, angular accelerations, rotor thrusts, jerk and snap are accepted and not used.
"""

from pathlib import Path

import numpy as np

from uam_control.coordinates import YAW, Z, arm_coordinates
from uam_control.grasp import grasp_windows
from uam_control.mission.motion.polynomials import Polynomials
from uam_control.mission.scenarios.environment import usual_load
from uam_control.mission.scenarios.fitted_spline import (
    CurveSamples,
    Misfit,
    between_rests,
    fitted,
    with_pauses,
    worst_swing,
)
from uam_control.mission.scenarios.route import Route
from uam_control.mission.scenarios.scenario import (
    LONGEST_FILE,
    Grip,
    Landing,
    Scenario,
    ScenarioError,
    check_length,
    standing,
)
from uam_control.mission.scenarios.scenario_options import AS_SCENARIO, RETURN, ScenarioOptions
from uam_control.settings.csv_table import CsvTable
from uam_control.vehicle import VehicleDescription

AXES = "xyz"
# group → its columns; a group is there as a whole or not at all
GROUPS = {
    "position": tuple(f"p{a}" for a in AXES),  # [m, ENU]
    "velocity": tuple(f"v{a}" for a in AXES),  # [m/s]
    "acceleration": tuple(f"a{a}" for a in AXES),  # [m/s^2]
    "quaternion": ("qw", "qx", "qy", "qz"),  # body FLU to ENU, of which yaw is used
    "yaw": ("yaw",),  # [rad]
    "yaw rate": ("dyaw",),  # [rad/s]
    "magnet": ("magnet",),  # 1: on from this row on, 0: off
}
OTHER_NAMES = {f"{k}_{a}": f"{k}{a}" for k in "pv" for a in AXES}
OTHER_NAMES |= {"gripper": "magnet"}
OTHER_NAMES |= {f"a_lin_{a}": f"a{a}" for a in AXES} | {f"q_{a}": f"q{a}" for a in "wxyz"}
NOT_USED = {f"{k}_{a}" for k in ("w", "a_rot", "jerk", "snap") for a in AXES}
NOT_USED |= {f"w{a}" for a in AXES} | {f"u_{i}" for i in range(1, 5)}
OTHER_UNITS = {"ms": 1e-3, "µs": 1e-6, "ns": 1e-9}  # of t [s]
PASSES_WITHIN = 1e-3  # [m or rad] distance of the interpolation from every row
LONG, CRAWL, FAR = 600.0, 0.01, 0.1  # [s, m/s, m] a race of 10 m/s, its times in ms, crawls
LARGEST = 1e6  # [SI] of a position, rate or angle
UNIT = 0.02  # largest deviation of a quaternion's norm from 1
FIRST_YAW = 4.0 * np.pi  # [rad] two turns: a larger heading of the first row is in degrees
# rates that fit the values: RMS of the difference to the change of the values / RMS of the rates
FITS, FITS_ANYWAY = 0.15, 0.05  # relative; absolute [SI]


def from_csv(file: Path, vehicle: VehicleDescription, options: ScenarioOptions) -> Scenario:
    """Read a trajectory, completed as in `route`; raises ScenarioError with line and column."""
    table = _Table(file, len(vehicle.joints))
    times = table.times - table.times[0]
    notes: list[str] = []
    path = _path(table, times, vehicle, notes)
    table.check_speed()
    end = RETURN if options.end == AS_SCENARIO else options.end
    grip = _grip(table, times, vehicle, notes)
    scenario = Scenario(
        name=file.stem,
        description=f"trajectory from {file.name}",
        arm_start=vehicle.stowed,
        phases=(),
        landing=Landing(0.0, 0.0),
        route=Route.around(path, end, options),
        notes=tuple(notes),
        grip=grip,
        payload_mass=0.0 if grip is None else usual_load(),
    )
    return scenario.begun_at(standing(vehicle.stowed))


class _Table:
    """Numbers of a file: `columns` by their own names; errors name the file's."""

    def __init__(self, file: Path, joints: int) -> None:
        """Read and check the header and the numbers."""
        self.file = file
        self._table = CsvTable(file, ScenarioError)
        self._groups = {**GROUPS, "arm": arm_coordinates(joints)}
        self._written = _names(self._table, self._groups)
        self._names = list(self._written)
        numbers = np.array(self._table.numbers(self._written.values()))
        if len(numbers) < 2:
            raise ScenarioError(f"{file}: at least two rows expected, got {len(numbers)}")
        t = numbers[:, self._names.index("t")]
        check_length(t[-1] - t[0], f"{file}: column t", LONGEST_FILE)  # before its pauses are made
        moving = [i for i, name in enumerate(self._names) if name not in ("t", "magnet")]
        self._numbers, self._rows = with_pauses(numbers, self._names.index("t"), moving)
        backward = np.flatnonzero(np.diff(self.times) <= 0.0)
        if len(backward):
            raise self.error(int(backward[0]) + 1, "t", "time does not increase")
        for name in self._written.keys() - {"t"}:
            if (far := np.abs(self._column(name)) > LARGEST).any():
                raise self.error(int(np.argmax(far)), name, f"beyond {LARGEST:g}")
        low = self.columns("position")[:, Z] <= 0.0
        if low.any():
            raise self.error(int(np.argmax(low)), "pz", "below the ground")

    @property
    def times(self) -> np.ndarray:
        """Times (m,) [s]."""
        return self._column("t")

    def check_speed(self) -> None:
        """Raise ScenarioError for a long flight that only crawls: its times are in another unit."""
        position, length = self.columns("position"), self.times[-1] - self.times[0]
        steps = np.linalg.norm(np.diff(position, axis=0), axis=1)
        fastest = float((steps / np.diff(self.times)).max())
        if length > LONG and 0.0 < fastest < CRAWL and float(np.ptp(position, axis=0).max()) > FAR:
            raise ScenarioError(
                f"{self.file}: column t: {length:.6g} s, but never faster than {fastest:.2g} m/s, "
                f"above {CRAWL:g} m/s is possible in a flight of more than {LONG:g} s; give times "
                "in seconds"
            )

    def columns(self, group: str) -> np.ndarray | None:
        """Return the columns of a group (m, k), None if the file does not have it."""
        names = self._groups[group]
        if names[0] not in self._names:
            return None
        return np.column_stack([self._column(name) for name in names])

    def error(self, row: int, column: str, text: str) -> ScenarioError:
        """Return the error of a row, counted from 0."""
        name = self._written.get(column, column)  # a column that the file may leave out
        return self._table.error(self.line(row), text, name)

    def line(self, row: int) -> int:
        """Return the line of a row, counted from 0."""
        return self._table.lines[self._rows[row]]

    def header_error(self, text: str) -> ScenarioError:
        """Return the error of the header."""
        return self._table.error(self._table.header_line, text)

    def _column(self, name: str) -> np.ndarray:
        return self._numbers[:, self._names.index(name)]


def _names(table: CsvTable, groups: dict[str, tuple[str, ...]]) -> dict[str, str]:
    """Return our name → name in the file, of the columns in use; raise ScenarioError."""

    def refused(text: str) -> ValueError:
        return table.error(table.header_line, text)

    known = {"t"}.union(*groups.values())
    found: dict[str, str] = {}
    for written in table.header:
        name = OTHER_NAMES.get(written, written)
        if name in found:
            raise refused(f"column {written} is there twice")
        if name in known:
            found[name] = written
        elif written not in NOT_USED:
            allowed = ",".join(["t", *(name for group in groups.values() for name in group)])
            raise refused(f"column {written!r} is unknown; known: {allowed}")
    for group, names in groups.items():
        missing = [name for name in names if name not in found]
        if not missing or (len(missing) == len(names) and group != "position"):
            continue
        there = [name for name in names if name in found]
        beside = f" beside {there[0]}" if there else ""
        raise refused(f"column {', '.join(missing)} is missing{beside}")
    if "t" not in found:
        raise refused("column t is missing")
    if "yaw" in found and "qw" in found:
        raise refused(f"column yaw beside {found['qw']}: only one is possible")
    return found


def _path(
    table: _Table, times: np.ndarray, vehicle: VehicleDescription, notes: list[str]
) -> Polynomials:
    """Return the interpolation (6 + n coordinates) of the rows."""
    velocity, acceleration = table.columns("velocity"), table.columns("acceleration")
    position = table.columns("position")
    if acceleration is not None and velocity is None:
        raise table.header_error("ax, ay, az need vx, vy, vz beside them")
    if acceleration is not None and not _fits(times, velocity, acceleration):
        notes.append(f"{table.file.name}: ax, ay, az do not fit vx, vy, vz and are not used")
        acceleration = None
    if velocity is not None and not _fits(times, position, velocity, acceleration):
        for unit, seconds in OTHER_UNITS.items():
            if _fits(seconds * times, position, velocity):
                raise table.header_error(f"t is in {unit}, as vx, vy, vz show; seconds expected")
        notes.append(f"{table.file.name}: vx, vy, vz do not fit px, py, pz and are not used")
        velocity = acceleration = None
    yaw, turning = _yaw(table), table.columns("yaw rate")
    if turning is not None and not _fits(times, yaw, turning):
        notes.append(f"{table.file.name}: dyaw does not fit yaw and is not used")
        turning = None
    names = arm_coordinates(len(vehicle.joints))
    angles = table.columns("arm")
    if angles is not None:
        _check_angles(table, angles, vehicle, names)
    else:
        angles = np.tile(vehicle.stowed, (len(times), 1))
    heading = "yaw" if table.columns("quaternion") is None else "qw"
    columns = (GROUPS["position"], (heading,), names)
    groups = (
        CurveSamples(position, velocity, acceleration),
        CurveSamples(yaw, turning),
        CurveSamples(angles),
    )
    try:
        curves = fitted(times, groups, PASSES_WITHIN)
    except Misfit as error:
        raise table.error(
            error.row,
            columns[error.group][0],
            f"no smooth curve passes within {PASSES_WITHIN:g}; it is {error.distance:.3g} off here:"
            " filter the noise, or give more rows",
        ) from None
    for named, samples, curve in zip(columns, groups, curves, strict=True):
        _check_gaps(table, named, samples, curve)
    base, heading, arm = curves
    powers = base.coefficients
    none = np.zeros((*powers.shape[:2], YAW - Z - 1))  # roll and pitch
    together = (powers, none, heading.coefficients, arm.coefficients)
    return Polynomials(base.knots, np.concatenate(together, axis=2))


def _grip(
    table: _Table, times: np.ndarray, vehicle: VehicleDescription, notes: list[str]
) -> Grip | None:
    """Return what the column `magnet` says; None without the column, or if it is never on."""
    column = table.columns("magnet")
    if column is None:
        return None
    on = column[:, 0]
    wrong = (on != 0.0) & (on != 1.0)
    wrong[0] |= on[0] == 1.0
    if wrong.any():
        row = int(np.argmax(wrong))
        text = "0 expected in the first row" if row == 0 else "0 or 1 expected"
        raise table.error(row, "magnet", f"{on[row]:g}: {text}")
    if not on.any():
        return None
    changes = np.flatnonzero(np.diff(on)) + 1
    switches = tuple((float(times[row]), bool(on[row])) for row in changes)
    names = arm_coordinates(len(vehicle.joints))
    values = dict(zip("xyz", table.columns("position").T, strict=True))
    values |= {"yaw": _yaw(table)[:, 0]}
    if (angles := table.columns("arm")) is not None:
        values |= dict(zip(names, angles.T, strict=True))
    rests = between_rests(times, values)
    picks = sum(switched for _, switched in switches)
    if len(grasp_windows(rests, switches)) < picks:
        notes.append(
            f"{table.file.name}: a pick is judged only with a descent to a pause before the magnet "
            "is on, and a climb after it"
        )
    return Grip(switches, rests)


def _check_gaps(
    table: _Table, names: tuple[str, ...], samples: CurveSamples, curve: Polynomials
) -> None:
    """Raise ScenarioError where rows are so far apart that the curve swings out between them."""
    swing = worst_swing(table.times - table.times[0], samples, curve)
    if swing is None:
        return
    unit = "m" if names == GROUPS["position"] else "rad"
    apart = table.times[swing.row + 1] - table.times[swing.row]
    raise table.error(
        swing.row + 1,
        names[swing.column],
        f"{apart:.3g} s after line {table.line(swing.row)}, and the smooth curve swings out of the "
        f"two rows by {swing.distance:.2g} {unit}; give rows between them",
    )


def _yaw(table: _Table) -> np.ndarray:
    """Return the heading (m, 1) [rad], without jumps; 0 if the file has none."""
    yaw, quaternion = table.columns("yaw"), table.columns("quaternion")
    if quaternion is not None:
        norm = np.linalg.norm(quaternion, axis=1)
        if (np.abs(norm - 1.0) > UNIT).any():
            row = int(np.argmax(np.abs(norm - 1.0)))
            raise table.error(row, "qw", f"the quaternion's norm is {norm[row]:.3g}, 1 expected")
        w, x, y, z = quaternion.T
        yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))[:, None]
    elif yaw is not None and abs(first := float(yaw[0, 0])) > FIRST_YAW:
        text = f"{first:g} rad, more than two turns; give the heading in radians, not in degrees"
        raise table.error(0, "yaw", text)
    return np.zeros((len(table.times), 1)) if yaw is None else np.unwrap(yaw, axis=0)


def _fits(
    times: np.ndarray,
    values: np.ndarray,
    rates: np.ndarray,
    second: np.ndarray | None = None,
) -> bool:
    """Return whether rates (m, k) are those of values (m, k), by the trapezoidal rule.

    second: derivative of the rates, for its correction.
    """
    width = np.diff(times)[:, None]
    mean = (rates[:-1] + rates[1:]) / 2.0
    if second is not None:
        mean += width / 12.0 * (second[:-1] - second[1:])
    apart = np.sqrt(np.mean((np.diff(values, axis=0) / width - mean) ** 2))
    return bool(apart <= FITS_ANYWAY + FITS * np.sqrt(np.mean(rates**2)))


def _check_angles(
    table: _Table, angles: np.ndarray, vehicle: VehicleDescription, names: tuple[str, ...]
) -> None:
    """Raise ScenarioError for the first of angles (m, n) [rad] out of its joint's range."""
    low = np.array([joint.low for joint in vehicle.joints])
    high = np.array([joint.high for joint in vehicle.joints])
    beyond = np.argwhere((angles < low) | (angles > high))
    if len(beyond):
        row, i = beyond[0]
        raise table.error(
            row,
            names[i],
            f"joint angle beyond its range, {low[i]:.2f} to {high[i]:.2f} rad",
        )
