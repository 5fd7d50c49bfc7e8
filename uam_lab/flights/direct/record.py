"""One tick of the direct engine into its row of the recording.

An IMU sample arrives some ticks after it was taken. The true values and the commands in force are
kept that long in a ring, so that a row has those of the moment of its sample.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from uam_control.coordinates import ROLL
from uam_control.maths.compiled import jit, prepared
from uam_control.stages.control_tick import Signals
from uam_control.stamps import SECOND
from uam_lab.records.results.timeseries import Columns, FlightTable
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
        )


class RowLayout(NamedTuple):
    """Where a tick's values go: places, the row of the truth, and three arrays each of the
    published gains and of their columns."""

    at: Places
    truth: TruthRow
    gains: tuple[np.ndarray, ...]
    gain_columns: tuple[np.ndarray, ...]


class TickRecorder:
    """Writes the ticks of a flight into `table`."""

    def __init__(
        self,
        table: FlightTable,
        truth: TruthRow,
        gains: Sequence[np.ndarray],
        gain_columns: Sequence[np.ndarray],
        period: float,
    ) -> None:
        """truth: of the plant; gains, gain_columns: as in `RowLayout`; period [s] of the ticks."""
        self.table = table
        rotors = table.columns.rotors
        places = Places.of(table.columns)
        self._layout = RowLayout(places, truth, tuple(gains), tuple(gain_columns))
        self._ring = np.full((KEPT, MOTORS + rotors + truth.width), np.nan)
        self._truths = list(self._ring[:, MOTORS + rotors :])
        self._period = period
        self._first = self._next = 0  # ticks whose IMU sample has not arrived: first, last + 1
        self._lag = 0  # ticks from an IMU sample to its arrival
        self._write: Callable | None = None  # `record` for the types of the first row

    def truth(self) -> np.ndarray:
        """Return the row for the true values of this tick, see `Plant.observe`."""
        return self._truths[self._next % KEPT]

    def write(
        self,
        time: float,
        motors: np.ndarray,
        magnet: bool,
        signals: Signals,
        sent: tuple[np.ndarray, float],
    ) -> None:
        """Write the row of a tick.

        time [s] of the plant; motors (rotors,) 0..1 and magnet: the commands in force at its
        begin; sent: body rates (3,) [rad/s] and thrust of the setpoint.
        """
        table = self.table
        number = table.next_number(signals.phase)
        arguments = (
            table.values,
            number,
            self._ring,
            self._first,
            self._next,
            time,
            motors,
            float(magnet),
            signals.stamp / SECOND - self._period / 2.0,
            signals.time,
            signals.state,
            signals.reference,
            signals.attitude_reference,
            signals.tau_p,
            signals.tau_q,
            signals.tau_alpha,
            sent[0],
            sent[1],
            signals.thrust_factor,
            self._layout,
        )
        if self._write is None:
            self._write = prepared(record, *arguments)
        self._first = self._write(*arguments)
        self._next += 1
        self._lag = self._next - self._first

    def write_blind(self, time: float, motors: np.ndarray, magnet: bool, phase: str) -> None:
        """Write the row of a tick without an IMU sample: the last row with the new true state.

        Arguments as of `write`. There is no row before the first tick with a sample.
        """
        keep(self._ring[self._next % KEPT], time, motors, float(magnet))
        self._next += 1
        table = self.table
        if table.count and self._next - self._first > self._lag:
            row = table.next_row(phase)
            row[:] = table.values[table.count - 2]
            row[0] += self._period
            write_truth(row, self._ring[self._first % KEPT], len(motors), self._layout)
            self._first += 1


@jit
def keep(row: np.ndarray, time: float, motors: np.ndarray, magnet: float) -> None:
    """Write time [s] and the commands in force, motors (rotors,) and magnet, to a row of the
    ring."""
    row[TIME], row[MAGNET] = time, magnet
    for i in range(len(motors)):
        row[MOTORS + i] = motors[i]


@jit
def record(
    table: np.ndarray,
    number: int,
    ring: np.ndarray,
    first: int,
    newest: int,
    now: float,
    motors: np.ndarray,
    magnet: float,
    earliest: float,
    time: float,
    state: np.ndarray,
    reference: np.ndarray,
    attitude_reference: np.ndarray,
    tau_p: np.ndarray,
    tau_q: np.ndarray,
    tau_alpha: np.ndarray,
    rates: np.ndarray,
    command: float,
    factor: float,
    layout: RowLayout,
) -> int:
    """Copy one tick into row `number` of the table (rows, columns).

    first, newest: numbers of the ticks that the ring (KEPT, ...) has: the first without a row, and
    this one, begun at `now` [s] with the commands motors (rotors,) and magnet. Returns the number
    after the tick that is written: the first one that is not before `earliest` [s], when the IMU
    sample was taken. The reference of roll and pitch is the desired attitude of tau_p.
    """
    keep(ring[newest % len(ring)], now, motors, magnet)
    first = max(first, newest + 1 - len(ring))
    while first < newest and ring[first % len(ring), TIME] < earliest:
        first += 1
    row = table[number]
    write_truth(row, ring[first % len(ring)], len(motors), layout)
    at, gains, gain_columns = layout.at, layout.gains, layout.gain_columns
    row[0] = time
    size = state.shape[1]
    for i in range(3):
        for j in range(size):
            row[at.estimate + size * i + j] = state[i, j]
            row[at.reference + size * i + j] = reference[i, j]
        for j in range(3):
            row[at.reference + size * i + ROLL + j] = attitude_reference[i, j]
        row[at.tau_p + i] = tau_p[i]
        row[at.tau_q + i] = tau_q[i]
        row[at.setpoint + i] = rates[i]
    for i in range(len(tau_alpha)):
        row[at.tau_alpha + i] = tau_alpha[i]
    row[at.setpoint + 3] = command
    for subsystem in range(3):
        columns, values = gain_columns[subsystem], gains[subsystem]
        for i in range(len(columns)):
            row[columns[i]] = values[i]
    row[at.factor] = factor
    return first + 1


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
