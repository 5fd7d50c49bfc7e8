"""One tick of the direct engine into its row of the recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uam_control.coordinates import ROLL
from uam_control.maths.compiled import jit
from uam_lab.results.timeseries import Columns
from uam_sim_bridge.plant import Truth


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


@dataclass(slots=True)
class Snapshot:
    """The truth of one tick, at plant time [s].

    motors (n,), magnet: the commands in force then, which are those of the tick before.
    """

    time: float
    truth: Truth
    motors: np.ndarray
    magnet: bool


class RowLayout(NamedTuple):
    """Where a tick's values go: places, and three arrays each of the published gains and of their
    columns."""

    at: Places
    gains: tuple[np.ndarray, ...]
    gain_columns: tuple[np.ndarray, ...]


@jit
def record(
    row: np.ndarray,
    time: float,
    truth: np.ndarray,
    state: np.ndarray,
    reference: np.ndarray,
    attitude_reference: np.ndarray,
    tau_p: np.ndarray,
    tau_q: np.ndarray,
    tau_alpha: np.ndarray,
    rates: np.ndarray,
    command: float,
    factor: float,
    motors: np.ndarray,
    thrust: np.ndarray,
    payload_position: np.ndarray,
    payload_quaternion: np.ndarray,
    magnet: tuple[float, float, float],
    layout: RowLayout,
) -> None:
    """Copy one tick into its row of the recording.

    The reference of roll and pitch is the desired attitude of tau_p. magnet: on, force [N], swing
    [rad].
    """
    at, gains, gain_columns = layout
    row[0] = time
    size = truth.shape[1]
    for i in range(3):
        for j in range(size):
            row[at.truth + size * i + j] = truth[i, j]
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
    for i in range(len(motors)):
        row[at.command + i] = motors[i]
        row[at.thrust + i] = thrust[i]
    for i in range(3):
        row[at.payload + i] = payload_position[i]
    for i in range(4):
        row[at.payload + 3 + i] = payload_quaternion[i]
    for subsystem in range(3):
        columns, values = gain_columns[subsystem], gains[subsystem]
        for i in range(len(columns)):
            row[columns[i]] = values[i]
    row[at.factor] = factor
    for i in range(3):
        row[at.magnet + i] = magnet[i]


def record_blind(row: np.ndarray, shot: Snapshot, at: Places) -> None:
    """Write the true state of a tick without an IMU sample into a copy of the last row."""
    truth, rotors = shot.truth, len(shot.motors)
    row[at.truth : at.truth + truth.state.size] = truth.state.ravel()
    row[at.command : at.command + rotors] = shot.motors
    row[at.thrust : at.thrust + rotors] = truth.rotor_thrust
    row[at.payload : at.payload + 3] = truth.payload_position
    row[at.payload + 3 : at.payload + 7] = truth.payload_quaternion
    row[at.magnet : at.magnet + 3] = shot.magnet, truth.magnet_force, truth.magnet_swing
