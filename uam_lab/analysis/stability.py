"""The whole analysis of one flight: `analyse`, and its result as the dictionary for JSON."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from uam_control.laws.modular import ModularLaw, ModularParameters
from uam_control.profiles.profile import load_profile
from uam_control.vehicle import DEFAULT_VEHICLE, load_description
from uam_lab.analysis import (
    assumptions,
    constants,
    coupling,
    dynamics,
    lyapunov_bound,
    supply,
    tracking,
)
from uam_lab.analysis.supply import COLUMNS_OF, NODE_OF
from uam_lab.records.results.timeseries import SUBSYSTEMS, Series
from uam_sim_bridge.plant import Vehicle

LAW = ModularLaw.kind.law


@dataclass(frozen=True)
class Subsystem:
    """V_j of one subsystem along the flight, and its bounds by the Appendix."""

    constants: np.ndarray  # (4,) K*, the smallest
    printed: np.ndarray  # (4,) K* by the paper's expressions
    parts: lyapunov_bound.Parts
    comparison: lyapunov_bound.ComparisonSystem
    decrease: np.ndarray  # (m,) upper bound of dV_j/dt, see lyapunov.decrease
    gains: np.ndarray  # (m, 4) K0..K3 as flown
    zeta: np.ndarray  # (m,)
    theta: np.ndarray  # (n,) constant part of sigma_j that theta_hat_j can take
    error: np.ndarray  # (m,) ||xi_j||
    error_bound: float  # bound of ||xi_j|| from V_j <= max(V_j(0), B_j)


@dataclass(frozen=True)
class Stability:
    """The analysis of one flight at m ticks in the air."""

    rows: np.ndarray
    time: np.ndarray  # (m,) mission time [s]
    truth: tracking.Tracking
    supply: supply.Supply
    coupling: coupling.Coupling
    subsystems: dict[str, Subsystem]
    assumptions: dict[str, Any]

    @cached_property
    def total(self) -> np.ndarray:
        """Return V (m,), eq. (31)."""
        return sum(s.parts.total for s in self.subsystems.values())

    @cached_property
    def comparison(self) -> lyapunov_bound.ComparisonSystem:
        """Return rate and growth of V, eq. (51), new."""
        p, q, alpha = (self.subsystems[name].comparison for name in SUBSYSTEMS)
        return p + q + alpha

    def summary(self) -> dict[str, Any]:
        """Return the content of stability.json: SI units, gains and V without unit."""
        found = {"ticks": len(self.time), "from_s": self.time[0], "until_s": self.time[-1]}
        found["V"] = check(self.time, self.total, self.comparison)
        for name, s in self.subsystems.items():
            columns = COLUMNS_OF[name]
            found[name] = {
                "V": check(self.time, s.parts.total, s.comparison),
                "step_inequality_holds": np.mean(
                    np.gradient(s.parts.total, self.time) <= s.decrease
                ),
                "V_tracking_max": s.parts.tracking.max(),
                "xi_max": s.error.max(),
                "xi_bound": s.error_bound,
                "K_star": s.constants,
                "K_star_by_the_papers_expressions": s.printed,
                "K_max": s.gains.max(axis=0),
                "zeta_min": s.zeta.min(),
                "zeta_max": s.zeta.max(),
                "theta": s.theta,
                "sigma_max": self.coupling.sigma_norm(name).max(),
                "coupling": shares(self.coupling, self.supply, columns),
            }
        found["assumptions"] = self.assumptions
        return found


def check(
    time: np.ndarray, value: np.ndarray, comparison: lyapunov_bound.ComparisonSystem
) -> dict[str, Any]:
    """Compare V (m,) with max(V(0), B) and with its envelope, and dV/dt with -rate V + growth.

    time (m,) [s]. falls_above_bound: fraction of the ticks with V > B in which V decreases, None
    if there is no such tick.
    """
    limit = max(value[0], comparison.bound)
    envelope = comparison.envelope(value[0], time - time[0])
    slope = np.gradient(value, time)
    above = value > comparison.bound
    return {
        "start": value[0],
        "max": value.max(),
        "bound": comparison.bound,
        "rate_per_s": comparison.rate,
        "growth_per_s": comparison.growth,
        "within_bound": np.mean(value <= limit * (1.0 + 1e-12)),
        "largest_ratio_to_bound": value.max() / limit,
        "within_envelope": np.mean(value <= envelope * (1.0 + 1e-9)),
        "largest_ratio_to_envelope": np.max(value / envelope),
        "rate_inequality_holds": np.mean(slope <= -comparison.rate * value + comparison.growth),
        "falls_above_bound": np.mean(slope[above] < 0.0) if above.any() else None,
    }


def shares(forces: coupling.Coupling, terms: supply.Supply, columns: slice) -> dict[str, Any]:
    """Return the RMS [N, N m] of the true coupling force and of each term against it, per axis.

    *_share: the part of the coupling that a term compensates, <term, H> / <H, H> over all axes;
    known_share: of H and the known loads, the loads' part.
    """
    plant = forces.plant[:, columns]
    met = {
        "adaptive": terms.adaptive[:, columns],
        "feedback": terms.feedback[:, columns],
        "integral": terms.integral[:, columns],
        "actuators": (terms.applied - terms.tau)[:, columns],
    }
    found = {"rms": rms(plant), "rest_rms": rms(forces.rest[:, columns])}
    for name, term in met.items():
        found[f"{name}_rms"] = rms(term)
        found[f"{name}_share"] = share(term, plant)
    known = terms.known[:, columns]
    found["known_share"] = share(known, plant + known)
    if columns == COLUMNS_OF["arm"]:  # the torque of its servos is not recorded
        found["actuators_rms"] = found["actuators_share"] = None
    return found


def share(term: np.ndarray, force: np.ndarray) -> float | None:
    """Return <term, force> / <force, force>, both (m, axes); None without a force."""
    power = float(np.sum(force**2))
    return float(np.sum(term * force)) / power if power else None


def rms(values: np.ndarray) -> np.ndarray:
    """Return the root mean square of values (m, axes) over the ticks: (axes,)."""
    return np.sqrt(np.mean(values**2, axis=0))


def analyse(series: Series, sets: dict, vehicle: Vehicle, payload_mass: float) -> Stability | None:
    """Return the analysis of a flight of the modular law.

    sets: the profile's parameter sets by node; payload_mass [kg].
    Returns None if fewer than ticks.FEWEST airborne ticks have finite adaptation.* columns.
    """
    rows = tracking.in_the_air(series)
    if len(rows) < tracking.FEWEST:
        return None
    printed = sets["attitude_controller"].error_rate_form == "printed"
    truth, estimate = (
        tracking.along(series, rows, source, printed) for source in ("truth", "estimate")
    )
    true = dynamics.along(series, rows, vehicle, payload_mass)
    terms = supply.along(series, rows, estimate, sets, dynamics.Body(vehicle))
    acceleration = series.block("truth.")[rows, 2 * series.columns.size :]
    forces = coupling.along(true, acceleration, terms, sets)
    regressors = constants.regressor(truth)
    subsystems, ceilings, seen = {}, {}, {}
    for name in SUBSYSTEMS:
        parameters = sets[NODE_OF[name]]
        theta = constants.steady(forces.sigma[:, COLUMNS_OF[name]], parameters)
        sigma = np.linalg.norm(forces.sigma[:, COLUMNS_OF[name]] - theta, axis=1)
        best = constants.smallest(sigma, regressors, np.array(parameters.nu))
        printed_ones = constants.from_the_paper(name, true, forces, terms, truth, sets)
        found = _subsystem(name, series, rows, truth, parameters, (best, printed_ones), theta)
        subsystems[name] = found
        ceilings[name] = assumptions.at_ceiling(found.gains, parameters.k_ceiling)
        seen[name] = assumptions.acceleration(series, rows, truth, parameters)
    margins = {
        "mass_matrix": assumptions.mass_matrix(true, sets),
        "saturated": assumptions.saturated(terms, sets),
        "at_ceiling": ceilings,
        "acceleration": seen,
        "estimator": assumptions.estimator(truth, estimate),
        "error_rate": assumptions.error_rate(truth),
        "forms": assumptions.switches(sets),
    }
    return Stability(rows, series.time[rows], truth, terms, forces, subsystems, margins)


def _subsystem(
    name: str,
    series: Series,
    rows: np.ndarray,
    truth: tracking.Tracking,
    parameters: ModularParameters,
    found: tuple[np.ndarray, np.ndarray],
    theta: np.ndarray,
) -> Subsystem:
    """Return V_j and its bound; parameters: of this subsystem; found: K* (4,), used and printed."""
    best, printed_ones = found
    columns = COLUMNS_OF[name]
    gains = np.column_stack([series[f"adaptation.{name}.K{i}"][rows] for i in range(4)])
    zeta = np.maximum(series[f"adaptation.{name}.zeta"][rows], 1e-12)
    record = parameters.record()[0]
    bias_error = supply.bias(series, name)[rows] - theta
    parts = lyapunov_bound.parts(name, record, truth, gains, zeta, best, bias_error)
    comparison = lyapunov_bound.comparison(parameters, zeta, best, theta)
    largest = max(parts.total[0], comparison.bound)
    xi = np.hstack([truth.e[:, columns], truth.e_dot[:, columns]])
    return Subsystem(
        constants=best,
        printed=printed_ones,
        parts=parts,
        comparison=comparison,
        decrease=lyapunov_bound.decrease(name, parameters, truth, gains, zeta, best, theta),
        gains=gains,
        zeta=zeta,
        theta=theta,
        error=np.linalg.norm(xi, axis=1),
        error_bound=lyapunov_bound.error_bound(record, largest),
    )


def analyse_folder(directory: Path, series: Series) -> Stability | None:
    """Return the analysis, or None for another law or for a flight with too few airborne ticks.

    Raises ProfileError if parameters.yaml is missing or is no profile of the modular law.
    """
    info = series.info
    if info.get("controller", LAW) != LAW:
        return None
    described = load_description(info.get("vehicle") or DEFAULT_VEHICLE)
    sets = load_profile(str(directory / "parameters.yaml"), vehicle=described).sets
    vehicle = Vehicle.of(described).changed(info.get("vehicle_changes") or {})
    return analyse(series, sets, vehicle, info.get("payload_mass_kg") or 0.0)
