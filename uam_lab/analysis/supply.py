"""The terms of tau_j and the forces of the actuators along a flight, per axis."""

from dataclasses import dataclass

import numpy as np

from uam_control.control.output_limits import ArmLimits, PositionLimits, integrate
from uam_control.coordinates import ALPHA, ARM, ATTITUDE, POSITION, Z
from uam_control.maths.rotations import matrix_from_euler
from uam_lab.analysis.dynamics import Body
from uam_lab.analysis.tracking import Tracking
from uam_lab.records.results.timeseries import SUBSYSTEMS, Series

COLUMNS_OF = {"position": POSITION, "attitude": ATTITUDE, "arm": ARM}
NODE_OF = {name: f"{name}_controller" for name in SUBSYSTEMS}


@dataclass(frozen=True)
class Supply:
    """Terms of tau at m ticks, eq. (8a), tau_p; (18a), tau_q; (25a), tau_alpha.

    All (m, 6 + n): N, world (p), N m, FLU (q), N m (alpha).
    tau = feedforward + feedback + adaptive + known + integral.
    """

    feedforward: np.ndarray  # Mbar chi_d_ddot
    feedback: np.ndarray  # -Mbar Lambda xi
    adaptive: np.ndarray  # -Mbar dtau
    known: np.ndarray  # the weight, drag, washout, the arm's known load; limits
    integral: np.ndarray  # -Mbar times the integral action of position and arm
    tau: np.ndarray  # as recorded, after its limits
    applied: np.ndarray  # force and torque of the rotors; tau for the arm (no recorded torque)


def along(series: Series, rows: np.ndarray, estimate: Tracking, sets: dict, body: Body) -> Supply:
    """Return the terms at `rows` (m,).

    estimate: errors of the estimated state, the input of the law. sets: parameter sets by node.
    """
    shape = (len(rows), series.columns.size)
    feedforward, feedback, adaptive, integral = (np.zeros(shape) for _ in range(4))
    for name, columns in COLUMNS_OF.items():
        p = sets[NODE_OF[name]].record()[0]
        e, e_dot = estimate.e[:, columns], estimate.e_dot[:, columns]
        feedback[:, columns] = -p["inertia"] * (p["gain_e"] * e + p["gain_e_dot"] * e_dot)
        feedforward[:, columns] = p["inertia"] * estimate.acceleration_d[:, columns]
        r = p["p12"] * e + p["p22"] * e_dot
        length = np.linalg.norm(r, axis=1)
        scale = series[f"adaptation.{name}.rho"][rows] / np.maximum(length, p["varpi"])
        adaptive[:, columns] = -p["inertia"] * (r * scale[:, None] + bias(series, name)[rows])
    blocks = [series.block(f"{tau}.")[rows] for tau in ("tau_p", "tau_q", "tau_alpha")]
    recorded = np.hstack(blocks)
    for name in ("position", "arm"):
        action = integral_action(series, sets[NODE_OF[name]], COLUMNS_OF[name])
        integral[:, COLUMNS_OF[name]] = action[rows]
    applied = np.hstack([rotor_wrench(series, rows, body), blocks[2]])
    known = recorded - feedforward - feedback - adaptive - integral
    return Supply(feedforward, feedback, adaptive, known, integral, recorded, applied)


def bias(series: Series, subsystem: str) -> np.ndarray:
    """Return theta_hat (ticks, n) [m/s^2 or rad/s^2] as used at each tick.

    A row has what the law has made of it at its tick, for the next one.
    """
    axes = range(1, series.columns.size - ALPHA + 1) if subsystem == "arm" else range(1, 4)
    made = np.column_stack([series[f"adaptation.{subsystem}.bias{i}"] for i in axes])
    return np.vstack([made[:1], made[:-1]])


def integral_action(series: Series, p: PositionLimits | ArmLimits, columns: slice) -> np.ndarray:
    """Return the force (ticks, 3) [N, ENU] or torque (ticks, n) [N m] of the integral action.

    From the recorded errors of `columns`. It is integrated as in flight, at every tick at which the
    law runs; ticks of saturation count as the others.
    """
    gain, inertia = np.array(p.integral_gain), np.array(p.inertia)
    force, integral = np.zeros((len(series), len(gain))), np.zeros(len(gain))
    if not gain.any():
        return force
    estimate, reference = series.block("estimate."), series.block("reference.")
    e = (estimate - reference)[:, : series.columns.size][:, columns]  # of chi
    runs = np.isfinite(e).all(axis=1)
    if columns == POSITION:
        runs &= np.any(series.block("tau_p.") != 0.0, axis=1)
    steps = np.diff(series["time"], prepend=series["time"][0])
    for k in np.flatnonzero(runs):
        integrate(e[k], gain, p.integral_limit, False, steps[k], integral)
        force[k] = -inertia * integral
    return force


def rotor_wrench(series: Series, rows: np.ndarray, body: Body) -> np.ndarray:
    """Return force [N, world] and torque [N m, FLU] (m, 6) of the recorded rotor thrusts."""
    model = body.model
    count = len(body.rotor_names)
    thrust = np.column_stack([series[f"rotor_{i}.thrust"][rows] for i in range(1, count + 1)])
    torque = np.zeros((count, 3))  # per newton of thrust: r x e3 and the drag torque
    for i, name in enumerate(body.rotor_names):
        x, y, _ = model.site(name).pos
        torque[i] = y, -x, model.actuator(name).gear[5]
    attitudes = series.block("truth.")[rows, ATTITUDE]
    up = np.array([matrix_from_euler(euler)[:, Z] for euler in attitudes])
    return np.hstack([up * thrust.sum(axis=1)[:, None], thrust @ torque])
