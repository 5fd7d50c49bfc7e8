"""Tracking errors of a flight by the law's definition, from the true or the estimated state."""

from dataclasses import dataclass

import numpy as np

from uam_control.coordinates import ATTITUDE
from uam_control.laws.errors import tracking_errors
from uam_lab.records.results.timeseries import Series


@dataclass(frozen=True)
class Tracking:
    """Tracking errors at m ticks: eq. (5), err; e_q: (14), (15). SI units, world (p), FLU (q)."""

    e: np.ndarray  # (m, 8)
    e_dot: np.ndarray  # (m, 8)
    acceleration_d: np.ndarray  # (m, 8) chi_d_ddot as the law feeds it forward
    xi: np.ndarray  # (m,) ||xi|| of the whole vehicle
    acceleration: np.ndarray  # (m,) ||chi_ddot||
    rate: np.ndarray  # (m,) ||chi_dot||
    reference_rate: np.ndarray  # (m,) ||chi_d_dot||


def along(series: Series, rows: np.ndarray, source: str, printed: bool) -> Tracking:
    """Return the errors at `rows` (m,). source: "truth" or "estimate".

    printed: use e_q_dot as in eq. (15). The desired attitude is that of the same tick.
    """
    size = series.columns.size
    states = np.ascontiguousarray(series.block(f"{source}.")[rows]).reshape(-1, 3, size)
    references = np.ascontiguousarray(series.block("reference.")[rows]).reshape(-1, 3, size)
    errors = np.zeros((len(rows), 3, size))
    norms = np.zeros((len(rows), 3))
    for k in range(len(rows)):
        attitude = np.ascontiguousarray(references[k, :, ATTITUDE])
        tracking_errors(states[k], references[k], attitude, True, printed, errors[k], norms[k])
    e, e_dot, feedforward = errors.transpose(1, 0, 2)
    reference_rate = np.linalg.norm(references[:, 1], axis=1)
    return Tracking(e, e_dot, feedforward, *norms.T, reference_rate)
