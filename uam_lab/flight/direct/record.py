"""One tick of the direct engine into its row of the recording."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import jit
from uam_lab.results.timeseries import COLUMNS
from uam_sim_bridge.plant import Plant

# where each group of columns begins; constants of the compiled `record`
_TRUTH = COLUMNS.block("truth.").start
_ESTIMATE = COLUMNS.block("estimate.").start
_REFERENCE = COLUMNS.block("reference.").start
_TAU_P = COLUMNS["tau_p.x"]
_TAU_Q = COLUMNS["tau_q.roll"]
_TAU_ALPHA = COLUMNS["tau_alpha.1"]
_SETPOINT = COLUMNS["setpoint.rate_x"]
_FACTOR = COLUMNS["thrust.factor"]
_COMMAND = COLUMNS["rotor_1.command"]
_THRUST = COLUMNS["rotor_1.thrust"]
_PAYLOAD = COLUMNS.block("payload.").start
_MAGNET = COLUMNS["magnet.on"]


class Snapshot(NamedTuple):
    """The truth of one tick, at plant time [s]; see `plant.Truth`."""

    time: float
    state: np.ndarray
    thrust: np.ndarray
    payload_pose: np.ndarray
    magnet_force: float
    magnet_swing: float

    @classmethod
    def of(cls, plant: Plant) -> Snapshot:
        """A copy of what is true now."""
        truth = plant.truth()
        return cls(
            plant.time,
            truth.state,
            truth.rotor_thrust,
            np.concatenate((truth.payload_position, truth.payload_quaternion)),
            truth.magnet_force,
            truth.magnet_swing,
        )


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
    gains: tuple[np.ndarray, ...],
    gain_columns: tuple[np.ndarray, ...],
    motors: np.ndarray,
    thrust: np.ndarray,
    payload_pose: np.ndarray,
) -> None:
    """Copy one tick into its row of the recording; roll and pitch reference are what tau_p asks.

    gains, gain_columns: three arrays each, the published gains and where they go.
    """
    row[0] = time
    for i in range(3):
        for j in range(8):
            row[_TRUTH + 8 * i + j] = truth[i, j]
            row[_ESTIMATE + 8 * i + j] = state[i, j]
            row[_REFERENCE + 8 * i + j] = reference[i, j]
        for j in range(3):
            row[_REFERENCE + 8 * i + 3 + j] = attitude_reference[i, j]
        row[_TAU_P + i] = tau_p[i]
        row[_TAU_Q + i] = tau_q[i]
        row[_SETPOINT + i] = rates[i]
    for i in range(2):
        row[_TAU_ALPHA + i] = tau_alpha[i]
    row[_SETPOINT + 3] = command
    for i in range(4):
        row[_COMMAND + i] = motors[i]
        row[_THRUST + i] = thrust[i]
    for i in range(7):
        row[_PAYLOAD + i] = payload_pose[i]
    for subsystem in range(3):
        columns, values = gain_columns[subsystem], gains[subsystem]
        for i in range(len(columns)):
            row[columns[i]] = values[i]


def record_switches(row: np.ndarray, magnet: bool, truth: Snapshot, factor: float) -> None:
    """The rest of a tick: the magnet as commanded and as it is, the thrust factor."""
    row[_MAGNET], row[_MAGNET + 1 : _MAGNET + 3] = magnet, (truth.magnet_force, truth.magnet_swing)
    row[_FACTOR] = factor


def record_blind(row: np.ndarray, truth: Snapshot, motors: np.ndarray) -> None:
    """A tick without an IMU sample into a copy of the row before: truth and motors (4,) go on."""
    row[_TRUTH : _TRUTH + truth.state.size] = truth.state.ravel()
    row[_COMMAND : _COMMAND + 4], row[_THRUST : _THRUST + 4] = motors, truth.thrust
    row[_PAYLOAD : _PAYLOAD + 7] = truth.payload_pose
    row[_MAGNET + 1 : _MAGNET + 3] = truth.magnet_force, truth.magnet_swing
