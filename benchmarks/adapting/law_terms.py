"""What the adapted gains of any law contribute to its tau, and their share of the coupling.

`supply` splits tau of the modular law into the terms of the paper. Here the adaptive term of each
law is tau with its recorded gains minus tau without them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from uam_control.coordinates import Z
from uam_control.laws import catalogue
from uam_control.laws.law import LawInputs
from uam_lab.analysis import coupling, dynamics, supply, tracking
from uam_lab.analysis.supply import COLUMNS_OF, NODE_OF
from uam_lab.records.results.timeseries import SUBSYSTEMS, Series, gain_columns
from uam_sim_bridge.plant import Vehicle

TAU = {"position": "tau_p.", "attitude": "tau_q.", "arm": "tau_alpha."}


def shares(
    series: Series,
    sets: dict,
    vehicle: Vehicle,
    payload_mass: float = 0.0,
    phases: tuple[str, ...] = (),
) -> dict[str, dict[str, Any]]:
    """Return subsystem → share of the true coupling that each term carries, <term, H> / <H, H>.

    H of the arm has the weight of the links in it here, as most of these laws feed none forward.

    Terms: adaptive; feedback: that of the law without its gains; added: what the controller adds to
    the law (integral action, known loads, limits); actuators: what they do beyond tau (None for the
    arm, whose torque is not recorded). rms: of H over all axes [N or N m].

    sets: parameter sets by node; payload_mass [kg]; phases: the ticks used, () for all in the air.
    {} with too few ticks.
    """
    rows = tracking.airborne(series)
    if phases:
        rows = rows[np.any([series.in_phase(name)[rows] for name in phases], axis=0)]
    if len(rows) < tracking.FEWEST:
        return {}
    printed = sets[NODE_OF["attitude"]].error_rate_form == "printed"
    estimate = tracking.along(series, rows, "estimate", printed)
    body = dynamics.Body(vehicle)
    true = dynamics.along(series, rows, vehicle, payload_mass)
    acceleration = series.block("truth.")[rows, 2 * series.columns.size :]
    plant = coupling.coupling_force(true, acceleration, sets)
    limits = sets[NODE_OF["position"]]
    plant[:, Z] -= limits.gravity_feedforward_mass * limits.gravity
    wrench = supply.rotor_wrench(series, rows, body)
    found = {}
    for name in SUBSYSTEMS:
        columns, p = COLUMNS_OF[name], sets[NODE_OF[name]]
        with_gains, without = terms(series, rows, name, p, estimate)
        force = plant[:, columns]
        inertia = np.array(p.inertia)
        tau = series.block(TAU[name])[rows]
        if name == "position":
            tau[:, Z] -= p.gravity_feedforward_mass * p.gravity
        met = {
            "adaptive": with_gains - without,
            "feedback": without - inertia * estimate.acceleration_d[:, columns],
            "added": tau - with_gains,
            "actuators": None,
        }
        if name != "arm":
            met["actuators"] = wrench[:, columns] - series.block(TAU[name])[rows]
        power = float(np.sum(force**2))
        found[name] = {"rms": float(np.sqrt(power / len(rows)))}
        for term, value in met.items():
            share = None if value is None or not power else float(np.sum(value * force)) / power
            found[name][term] = share
    return found


def terms(
    series: Series, rows: np.ndarray, subsystem: str, p: Any, estimate: tracking.Tracking
) -> tuple[np.ndarray, np.ndarray]:
    """Return tau (m, n) with the recorded gains, and without them; before limits and weight.

    p: parameter set of the subsystem. ||chi_ddot|| enters the recorded rho of the modular law.
    """
    law = catalogue.law(p.law)(p)
    columns = COLUMNS_OF[subsystem]
    names = law.gain_names(len(p.inertia))
    recorded = series.values[rows][:, gain_columns(subsystem, names, series.columns)]
    record, n = p.record(), len(p.inertia)
    found = np.zeros((2, len(rows), n))
    for k in range(len(rows)):
        inputs = LawInputs(
            estimate.e[k, columns].copy(),
            estimate.e_dot[k, columns].copy(),
            estimate.acceleration_d[k, columns].copy(),
            np.array([estimate.xi[k], 0.0, estimate.rate[k]]),
            False,
            True,
            0.0,
        )
        for which, gains in enumerate((recorded[k], np.zeros(len(names)))):
            memory = np.zeros(len(names) + law.memory)
            memory[: len(names)] = gains
            if p.law == catalogue.DEFAULT:  # rho as recorded stands for all its gains
                memory[:5] = 0.0
                memory[0] = gains[names.index("rho")]
            type(law).step(record, inputs, memory, found[which, k])
    return found[0], found[1]
