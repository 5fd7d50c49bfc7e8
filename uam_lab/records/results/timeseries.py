"""The recorded flight: a table with one row per control tick; this module names the columns.

Both engines write the same table. Metrics, figures and pictures read it by column name. In flight,
an engine fills a preallocated float64 array by column number:

    recording = FlightTable.of(ticks, vehicle)
    truth = recording.columns.block("truth.")
    recording.values[k, truth] = state.ravel()          # state (3, 6 + n): chi, chi_dot, chi_ddot

In the file a column is called "name [unit]"; in the code it is called by its name alone.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from uam_control.arm.hand import HEADING, hands, reach, shoulder
from uam_control.coordinates import ALPHA, ANGLES, CHI, POSITION, coordinates
from uam_control.laws import catalogue
from uam_control.maths.rotations import wrap_angle
from uam_control.mission.motion.flatness import Flyer, flattened
from uam_control.settings.atomic import replacing
from uam_control.settings.texts import unknown
from uam_control.vehicle import TWO_FINGER, VehicleDescription

GROUPS = TRUTH, REFERENCE, ERROR = "end_effector", "end_effector_reference", "end_effector_error"
COORDINATES = {"x": "m", "y": "m", "z": "m", "heading": "rad", "elevation": "rad"}


def _hand_columns() -> dict[str, str]:
    """Return the columns of the end effector: name → unit."""
    return {f"{group}.{name}": unit for group in GROUPS for name, unit in COORDINATES.items()}


def of_the_hand(
    flyer: Flyer, truth: np.ndarray, reference: np.ndarray, swing: np.ndarray
) -> np.ndarray:
    """Return the columns (ticks, 15) in the order of `declared`.

    truth: chi (ticks, 6 + n); reference (3, ticks, 6 + n): its attitude is replaced; swing
    (ticks,) [rad]: of the hinge that a hand hangs on, NaN: unknown.
    """
    flattened(reference, flyer)
    found, wanted = hands(flyer.chain, truth, swing), hands(flyer.chain, reference[CHI])
    error = found - wanted
    error[:, HEADING:] = wrap_angle(error[:, HEADING:])
    return np.concatenate([found, wanted, error], axis=1)


SUBSYSTEMS = ("position", "attitude", "arm")
GAINS = "adaptation."  # begin of their columns' names
AXES = 3  # the largest number of axes of a subsystem
# Phases of the mission node on the ground; the scenario names those in flight.
ON_GROUND = ("waiting", "touchdown", "landed", "aborted")
PHASE_COLUMN = "phase"
METADATA_KEY = b"uam"


def _declare(joints: int, rotors: int, hand: bool, fingers: bool) -> dict[str, str]:
    """Return all numeric columns in file order: name → unit; hand, fingers: those of an end
    effector and of a two-finger gripper."""
    names = coordinates(joints)
    units = {name: "m" if name in names[POSITION] else "rad" for name in names}
    columns = {"time": "s"}
    for group in ("truth", "estimate", "reference"):
        for suffix, per in (("", ""), ("_dot", "/s"), ("_ddot", "/s^2")):
            columns |= {f"{group}.{c}{suffix}": unit + per for c, unit in units.items()}
    columns |= {f"error.{c}": unit for c, unit in units.items()}
    columns |= {f"tau_p.{axis}": "N" for axis in "xyz"}
    columns |= {f"tau_q.{axis}": "N m" for axis in ("roll", "pitch", "yaw")}
    columns |= {f"tau_alpha.{joint}": "N m" for joint in range(1, joints + 1)}
    columns |= {f"setpoint.rate_{axis}": "rad/s" for axis in "xyz"} | {"setpoint.thrust": "1"}
    columns |= {"thrust.factor": "1"}  # true / assumed, identified and applied
    # The gains of every law, NaN for those that did not fly. Their units differ with subsystem and
    # power of ||xi||; rho and zeta are those of tau before the multiplication by Mbar, so a unit
    # per column would mislead.
    gains = catalogue.gain_names(max(AXES, joints))
    columns |= {f"{GAINS}{s}.{gain}": "1" for s in SUBSYSTEMS for gain in gains}
    columns |= {f"rotor_{i}.command": "1" for i in range(1, rotors + 1)}
    columns |= {f"rotor_{i}.thrust": "N" for i in range(1, rotors + 1)}
    columns |= {f"payload.{axis}": "m" for axis in "xyz"}
    columns |= {f"payload.q{axis}": "1" for axis in "wxyz"}
    columns |= {"magnet.on": "1", "magnet.force": "N", "magnet.swing": "rad"}
    if fingers:
        columns |= {"gripper.opening": "m", "gripper.force": "N"}
    return columns | _hand_columns() if hand else columns


class Columns:
    """Numbers of the numeric columns by name or by prefix."""

    def __init__(self, units: Mapping[str, str]):
        self.units = dict(units)
        self.names = tuple(units)
        self._number = {name: i for i, name in enumerate(self.names)}

    @cached_property
    def size(self) -> int:
        """Number of entries of chi."""
        errors = self.block("error.")
        return errors.stop - errors.start

    @property
    def joints(self) -> int:
        return self.size - ALPHA

    @cached_property
    def rotors(self) -> int:
        return sum(name.startswith("rotor_") and name.endswith(".thrust") for name in self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, name: str) -> int:
        if name not in self._number:
            raise KeyError(f"{name}: {unknown(name, self.names)}")
        return self._number[name]

    def __contains__(self, name: str) -> bool:
        return name in self._number

    def block(self, prefix: str) -> slice:
        """Return the adjacent columns whose names start with `prefix`, as a slice.

        Raises KeyError if there is none or if they are not adjacent.
        """
        found = [i for i, name in enumerate(self.names) if name.startswith(prefix)]
        if not found or found[-1] - found[0] + 1 != len(found):
            raise KeyError(f"no block of columns {prefix!r}")
        return slice(found[0], found[-1] + 1)

    def label(self, name: str) -> str:
        """Return the column name in the file: "name [unit]"."""
        return f"{name} [{self.units[name]}]"


@cache
def columns(joints: int, rotors: int, hand: bool = False, fingers: bool = False) -> Columns:
    """Return the columns of a vehicle with so many joints and rotors; hand: an end effector;
    fingers: a two-finger gripper."""
    return Columns(_declare(joints, rotors, hand, fingers))


def columns_of(vehicle: VehicleDescription) -> Columns:
    hand = Flyer.with_hand(vehicle) is not None
    fingers = vehicle.gripper.kind == TWO_FINGER
    return columns(len(vehicle.joints), len(vehicle.rotors), hand, fingers)


def gain_columns(subsystem: str, names: Iterable[str], found: Columns) -> np.ndarray:
    """Return the column numbers (n,) of a subsystem's gains `names` among the columns `found`."""
    return np.array([found[f"{GAINS}{subsystem}.{name}"] for name in names], dtype=int)


class UnreadableFlight(ValueError):
    """The file contains no recorded flight."""


class FlightTable:
    """Preallocated table for recording a flight; unwritten entries are NaN."""

    @classmethod
    def of(cls, capacity: int, vehicle: VehicleDescription) -> Self:
        """Return a table for a vehicle, with its end effector if it has one."""
        return cls(capacity, columns_of(vehicle), Flyer.with_hand(vehicle))

    def __init__(self, capacity: int, columns: Columns, flyer: Flyer | None = None):
        """flyer: of the end effector, None without."""
        self._flyer = flyer
        self.columns = columns
        self.values = np.full((capacity, len(columns)), np.nan)
        self.phases = np.zeros(capacity, dtype=np.int8)
        self.phase_names: dict[str, int] = {}
        self.count = 0

    def next_row(self, phase: str) -> np.ndarray:
        """Return the row (columns,) of the next tick, to fill in place; a full table grows."""
        number = self.count
        if number == len(self.values):
            self.values = np.concatenate([self.values, np.full_like(self.values, np.nan)])
            self.phases = np.concatenate([self.phases, np.zeros_like(self.phases)])
        if phase not in self.phase_names:
            self.phase_names[phase] = len(self.phase_names)
        self.phases[number] = self.phase_names[phase]
        self.count = number + 1
        return self.values[number]

    def series(self, info: Mapping[str, Any] | None = None) -> "Series":
        """Return the recorded rows, with error columns, end effector and countdown computed."""
        values, columns = self.values[: self.count], self.columns
        count_down(values[:, columns["time"]])
        truth, reference = (values[:, columns.block(group)] for group in ("truth.", "reference."))
        chi = truth[:, : columns.size]
        error = chi - reference[:, : columns.size]
        error[:, ANGLES] = wrap_angle(error[:, ANGLES])
        values[:, columns.block("error.")] = error
        names, told = tuple(self.phase_names), dict(info or {})
        if self._flyer is not None:
            rows = reference.reshape(len(values), -1, columns.size).swapaxes(0, 1).copy()
            swing = values[:, columns["magnet.swing"]]
            hand = of_the_hand(self._flyer, chi, rows, swing)
            values[:, columns.block(TRUTH)] = hand
            told["arm_reach_m"] = reach(self._flyer.chain, shoulder(self._flyer.chain))
        return Series(values, self.phases[: self.count], names, told, columns)


def count_down(time: np.ndarray) -> None:
    """Replace the mission time (ticks,) [s] before take-off by a countdown to it, in place.

    In flight the time until take-off is unknown: the recorded value is constant.
    """
    start = int(np.argmax(time >= 0.0)) if np.any(time >= 0.0) else len(time)
    if 0 < start < len(time) - 1:
        time[:start] = time[start] - (time[start + 1] - time[start]) * np.arange(start, 0, -1)


@dataclass
class Series:
    """A whole flight: `values` (ticks, columns), `phases` (ticks,) numbers into `phase_names`."""

    values: np.ndarray
    phases: np.ndarray
    phase_names: tuple[str, ...]
    info: dict[str, Any]
    columns: Columns

    def __getitem__(self, name: str) -> np.ndarray:
        """Column (ticks,) by its name without unit."""
        return self.values[:, self.columns[name]]

    def __len__(self) -> int:
        return len(self.values)

    def block(self, prefix: str) -> np.ndarray:
        """Columns (ticks, n) whose names start with `prefix`."""
        return self.values[:, self.columns.block(prefix)]

    @cached_property
    def time(self) -> np.ndarray:
        """Mission time [s], 0 at the take-off command."""
        return self["time"]

    @property
    def tilt(self) -> np.ndarray:
        """Return the true tilt (ticks,) [rad]."""
        upright = np.cos(self["truth.roll"]) * np.cos(self["truth.pitch"])
        return np.arccos(np.clip(upright, -1.0, 1.0))

    @cached_property
    def flown(self) -> np.ndarray:
        """Mask (ticks,): from the take-off command to the touchdown command.

        The touchdown command is the start of the phase "landed", in which the mission disarms the
        vehicle. In an aborted flight it is the abort. With an odometry it is the start of the phase
        "touchdown", in which the landing seeks the ground.
        """
        on_ground = [name in ON_GROUND for name in self.phase_names]
        return (self.time >= 0.0) & ~np.array(on_ground)[self.phases]

    def in_phase(self, name: str) -> np.ndarray:
        """Return the mask (ticks,) of a phase."""
        if name not in self.phase_names:
            return np.zeros(len(self), dtype=bool)
        return self.phases == self.phase_names.index(name)

    def phase_spans(self) -> list[tuple[str, float, float]]:
        """Return the phases in order: (name, first time, first time of the next phase) [s]."""
        if not len(self):
            return []
        starts = np.flatnonzero(np.diff(self.phases, prepend=-1))
        ends = np.append(starts[1:], len(self) - 1)
        return [
            (self.phase_names[self.phases[a]], float(self.time[a]), float(self.time[b]))
            for a, b in zip(starts, ends, strict=True)
        ]

    def magnet_spans(self) -> list[tuple[float, float]]:
        """Return the intervals [s] with the magnet on."""
        on = np.nan_to_num(self["magnet.on"]) > 0.5
        edges = np.flatnonzero(np.diff(on.astype(np.int8), prepend=0, append=0))
        last = len(self) - 1
        return [
            (float(self.time[a]), float(self.time[min(b, last)]))
            for a, b in zip(edges[::2], edges[1::2], strict=True)
        ]

    def row_at(self, time: float) -> int:
        """Return the number of the first row at or after `time` [s]."""
        return int(min(np.searchsorted(self.time, time), len(self) - 1))

    def table(self) -> pa.Table:
        """Return the Arrow table: "name [unit]" columns, phase as dictionary, info as metadata."""
        phase = pa.DictionaryArray.from_arrays(
            pa.array(self.phases, pa.int8()), pa.array(self.phase_names, pa.string())
        )
        arrays = [pa.array(np.ascontiguousarray(column)) for column in self.values.T]
        labels = [self.columns.label(name) for name in self.columns.names]
        table = pa.table([arrays[0], phase, *arrays[1:]], [labels[0], PHASE_COLUMN, *labels[1:]])
        return table.replace_schema_metadata(
            {METADATA_KEY: json.dumps(self.info, sort_keys=True, default=str).encode()}
        )

    def write(self, path: Path) -> None:
        """Write the table to `path` atomically."""
        with replacing(path) as temporary:
            pq.write_table(self.table(), temporary, compression="zstd")


def read(path: Path) -> Series:
    """Read a flight from a file.

    Raises UnreadableFlight if it is no parquet file or if required columns are missing.
    """
    try:
        table = pq.read_table(path)
    except FileNotFoundError:
        raise UnreadableFlight(f"{path} does not exist") from None
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0]
        raise UnreadableFlight(f"{path}: not a readable flight ({reason})") from None
    found = _layout(table.column_names)
    missing = _missing(table.column_names, found)
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise UnreadableFlight(f"{path}: column {missing[0]!r}{more} missing")
    labels, nothing = map(found.label, found.names), np.full(len(table), np.nan)
    known = (table[one].to_numpy() if one in table.column_names else nothing for one in labels)
    values = np.column_stack(list(known))
    phase = table[PHASE_COLUMN].combine_chunks().dictionary_encode()
    if isinstance(phase, pa.ChunkedArray):
        phase = phase.combine_chunks()
    codes = phase.indices.to_numpy().astype(np.int8)
    names = tuple(phase.dictionary.to_pylist())
    info = json.loads((table.schema.metadata or {}).get(METADATA_KEY, b"{}"))
    return Series(values, codes, names, info, found)


def _layout(present: Iterable[str]) -> Columns:
    """Return the columns of a file whose columns are called `present`."""
    joints = sum(label.startswith("error.alpha_") for label in present)
    rotors = sum(label.startswith("rotor_") and ".thrust" in label for label in present)
    hand = any(one.startswith(f"{TRUTH}.") for one in present)
    return columns(joints, rotors, hand, any(one.startswith("gripper.") for one in present))


def _missing(present: Iterable[str], columns: Columns) -> list[str]:
    """Return the labels of the required columns that are not in `present`: all but the gains, as
    there may be other laws now than there were."""
    present, names = set(present), columns.names
    required = [columns.label(one) for one in names if not one.startswith(GAINS)] + [PHASE_COLUMN]
    return [label for label in required if label not in present]
