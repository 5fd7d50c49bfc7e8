"""One tick of the direct engine into its row of the recording.

An IMU sample arrives some ticks after it was taken. The true values and the commands in force are
kept that long in a ring, so that a row has those of the moment of its sample.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uam_control.coordinates import ROLL
from uam_control.maths.compiled import borrowing, jit
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import Number, record
from uam_control.stages.control_tick import ControlTick
from uam_control.stages.signals import SignalArrays
from uam_control.stages.step import DONE
from uam_control.stamps import SECOND
from uam_lab.records.results.timeseries import SUBSYSTEMS, Columns, FlightTable, gain_columns
from uam_sim_bridge.plant import TruthRow

KEPT = 64  # ticks in the ring: a quarter of a second, more than any sample takes
TIME, MAGNET, MOTORS = 0, 1, 2  # columns of the ring; the true values follow the motors'


class Places(NamedTuple):
    """Where each group of columns begins."""

    truth: int
    estimate: int
    reference: int
    tau_p: int
    tau_q: int
    tau_alpha: int
    setpoint: int
    factor: int
    command: int
    thrust: int
    payload: int
    magnet: int
    grip: int  # -1: not recorded

    @classmethod
    def of(cls, columns: Columns) -> Places:
        """Return those of a recording with these columns."""
        groups = ("truth.", "estimate.", "reference.", "tau_p.", "tau_q.", "tau_alpha.")
        return cls(
            *(columns.block(group).start for group in (*groups, "setpoint.")),
            columns["thrust.factor"],
            columns["rotor_1.command"],
            columns["rotor_1.thrust"],
            columns.block("payload.").start,
            columns["magnet.on"],
            columns["gripper.opening"] if "gripper.opening" in columns else -1,
        )


class RowLayout(NamedTuple):
    """Where a tick's values go."""

    at: Places
    truth: TruthRow
    gains: tuple[np.ndarray, ...]  # three arrays, the published ones
    gain_columns: tuple[np.ndarray, ...]  # three arrays, of their columns


# row: the next of the table. Ticks: first whose IMU sample has not arrived, the one after the
# newest; lag of a sample [ticks]. Of the plant, at the begin of the tick: magnet, time [s]. period
# [s]
WHOLE, REAL = "row first following lag magnet", "time period"


class RecordArrays(NamedTuple):
    """Of the `TickRecorder`."""

    table: np.ndarray  # (rows, columns)
    ring: np.ndarray  # (KEPT, ...) see `TickRecorder`
    layout: RowLayout
    signals: SignalArrays
    tau_alpha: np.ndarray  # (n,)
    sent: np.ndarray  # (4,) of `BridgeStage`
    bridge: np.ndarray  # (1,) of `BridgeStage`
    motors: np.ndarray  # (rotors,) commands 0..1
    numbers: np.ndarray  # (1,) WHOLE, REAL


class TickRecorder:
    """Writes the ticks of a flight into `table`; `arrays`: what compiled functions use.

    The ring has true values and commands of the newest ticks, by the number of the tick.
    """

    _row, _first, _following, _lag = (Number() for _ in range(4))

    def __init__(
        self,
        table: FlightTable,
        truth: TruthRow,
        control: ControlTick,
        motors: np.ndarray,
        period: float,
    ) -> None:
        """truth: of the plant; motors (rotors,): of the autopilot; period [s] of the ticks."""
        self.table, columns = table, table.columns
        laws = {name: control.laws[name].controller for name in SUBSYSTEMS}
        layout = RowLayout(
            Places.of(columns),
            truth,
            tuple(one.adaptation for one in laws.values()),
            tuple(gain_columns(name, one.names, columns) for name, one in laws.items()),
        )
        ring = np.full((KEPT, MOTORS + columns.rotors + truth.width), np.nan)
        self._truths = list(ring[:, MOTORS + columns.rotors :])
        self.memory, bridge = record(WHOLE, REAL), control.bridge
        self.memory["period"] = period
        self.arrays = RecordArrays(
            *(table.values, ring, layout, control.arrays, control.signals.tau_alpha),
            *(bridge.sent, bridge.memory, motors, self.memory),
        )
        self._write = bound(write, self.arrays)

    def truth(self) -> np.ndarray:
        """Return the row for the true values of this tick, see `Plant.observe`."""
        return self._truths[self._following % KEPT]

    def begin(self, time: float, magnet: bool) -> None:
        """Begin a tick at `time` [s] of the plant; magnet: the command in force."""
        self.memory["time"], self.memory["magnet"] = time, magnet

    def write(self, phase: str) -> None:
        """Write the row of a tick."""
        self._next_row(phase)
        self._write()

    def _next_row(self, phase: str) -> np.ndarray:
        row = self.table.next_row(phase)
        self.fit()
        return row

    def fit(self) -> None:
        """Use the present values of the table, which grows."""
        if self.table.values is not self.arrays.table:
            self.arrays = self.arrays._replace(table=self.table.values)
            self._write = bound(write, self.arrays)

    def write_blind(self, phase: str) -> None:
        """Write the row of a tick without an IMU sample: the last row with the new true state.

        There is no row before the first tick with a sample.
        """
        a, table = self.arrays, self.table
        time, magnet = self.memory["time"].item(), self.memory["magnet"].item()
        keep(a.ring[self._following % KEPT], time, a.motors, float(magnet))
        self._following += 1
        if table.count and self._following - self._first > self._lag:
            row = self._next_row(phase)
            row[:] = table.values[table.count - 2]
            row[0] += self.memory["period"].item()
            write_truth(row, a.ring[self._first % KEPT], len(a.motors), a.layout)
            self._first += 1
            self._row += 1

    @property
    def left(self) -> int:
        """Number of ticks that the table has room for before it must grow."""
        return len(self.table.values) - self._row

    def resume(self, phase: str) -> None:
        """Go on after compiled ticks, all in one phase."""
        table, row = self.table, self._row
        table.phases[table.count : row] = table.phase_names[phase]
        table.count = row


@borrowing
def record_step(arrays: tuple) -> int:
    """Write the row of a tick; arrays: `RecordArrays` alone."""
    (a,) = arrays
    write(a)
    return DONE


@jit
def keep(row: np.ndarray, time: float, motors: np.ndarray, magnet: float) -> None:
    """Write time [s] and commands in force, motors (rotors,) and magnet, to a row of the ring."""
    row[TIME], row[MAGNET] = time, magnet
    for i in range(len(motors)):
        row[MOTORS + i] = motors[i]


@borrowing
def write(a: RecordArrays) -> None:
    """Copy one tick into the next row of the table.

    The true values are those of the first tick that is not before the IMU sample was taken. The
    reference of roll and pitch is the desired attitude of tau_p.
    """
    m, s, at, ring = a.numbers[0], a.signals, a.layout.at, a.ring
    keep(ring[m.following % len(ring)], m.time, a.motors, float(m.magnet))
    first = max(m.first, m.following + 1 - len(ring))
    earliest = s.numbers[0].stamp / SECOND - m.period / 2.0
    while first < m.following and ring[first % len(ring), TIME] < earliest:
        first += 1
    row = a.table[m.row]
    write_truth(row, ring[first % len(ring)], len(a.motors), a.layout)
    row[0] = s.numbers[0].time
    size = s.state.shape[1]
    for i in range(3):
        for j in range(size):
            row[at.estimate + size * i + j] = s.state[i, j]
            row[at.reference + size * i + j] = s.reference[i, j]
        for j in range(3):
            row[at.reference + size * i + ROLL + j] = s.attitude_reference[i, j]
        row[at.tau_p + i] = s.tau_p[i]
        row[at.tau_q + i] = s.tau_q[i]
    for i in range(len(a.tau_alpha)):
        row[at.tau_alpha + i] = a.tau_alpha[i]
    for i in range(4):
        row[at.setpoint + i] = a.sent[i]
    for subsystem in range(3):
        columns, values = a.layout.gain_columns[subsystem], a.layout.gains[subsystem]
        for i in range(len(columns)):
            row[columns[i]] = values[i]
    row[at.factor] = a.bridge[0].factor
    m.first = first + 1
    m.following += 1
    m.lag = m.following - m.first
    m.row += 1


@jit
def write_truth(row: np.ndarray, kept: np.ndarray, rotors: int, layout: RowLayout) -> None:
    """Write the true values and the commands of a row of the ring into a row of the recording."""
    at, of, begin = layout.at, layout.truth, MOTORS + rotors
    for i in range(of.rotor_thrust - of.state):
        row[at.truth + i] = kept[begin + of.state + i]
    for i in range(rotors):
        row[at.command + i] = kept[MOTORS + i]
        row[at.thrust + i] = kept[begin + of.rotor_thrust + i]
    for i in range(7):
        row[at.payload + i] = kept[begin + of.payload + i]
    row[at.magnet] = kept[MAGNET]
    row[at.magnet + 1] = kept[begin + of.magnet]
    row[at.magnet + 2] = kept[begin + of.magnet + 1]
    if at.grip >= 0:
        row[at.grip] = kept[begin + of.grip]
        row[at.grip + 1] = kept[begin + of.grip + 1]
