"""Parameters of every law from one bandwidth per axis, and the strength that a margin allows.

Feedback. About zero error every law is Mbar (-lambda_1 e - lambda_2 e_dot) with lambda_1 = w^2 and
lambda_2 = 2 w for the bandwidth w: the modular law has these gains, ASMC-1 has (A + K/phi) = Mbar w
and Lambda = w, ASMC-2 has k_s = kappa = w.

Adaptation adds to that. Its largest effect is one number per subsystem, the strength g:

| law | adds at most | by |
|---|---|---|
| modular | g lambda_1 on e, ADDED g lambda_1 / lambda_2 on e_dot | ceilings of K0..K3, Q |
| ASMC-2 | g w_max (e_dot + w e), w_max: of its axes | ceilings of theta |
| ASMC-1 | the integral of g lambda_1 s | gamma |

`strengths` finds the largest g of each subsystem that leaves every loop the share of its margins
that the study demands.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from adapting.description import Row, Study
from uam_control.profiles.profile import Profile, load_profile, profile_of
from uam_control.settings import configuration
from uam_control.settings.parameter_file import read_sections
from uam_lab.experiments.margins.loops import Analysis, analyse
from uam_lab.experiments.margins.stack_model import Gains, stack_model
from uam_lab.records.results.timeseries import SUBSYSTEMS
from uam_sim_bridge.plant import Vehicle

ADDED = 1.1  # p22 lambda_2 / p12: nearly the largest, which a small half of Q on e_dot gives
NONE = 1e-9  # of an adapted gain: positive, as the laws require, and without effect
PARTS = np.array([0.7, 0.1, 0.1, 0.01])  # of the strength, that K0..K3 may have; ||chi_ddot|| to 10
SHARES = np.array([0.8, 0.1, 0.1])  # the same of theta_0..theta_2
# rho of ASMC-2 [m, rad]: far above the errors, because its gain grows towards the edge
TUNNEL = {"position": 1.5, "attitude": 0.7, "arm": 0.5}
STRENGTHS = (1e-2, 1e2)
HALVINGS, JOINT = 10, 5  # bisections
MODULAR, ASMC1, ASMC2 = "modular", "asmc1", "asmc2"
Strength = Mapping[str, float]  # subsystem → g
ZERO = dict.fromkeys(SUBSYSTEMS, 0.0)


def profile(
    study: Study,
    row: Row,
    strength: Mapping[str, Strength],
    gains: Mapping[str, np.ndarray] | None = None,
) -> Profile:
    """Return the parameters of a row.

    strength: by law; gains: subsystem → K0..K3, zeta of the row that is frozen as converged.
    """
    vehicle = study.vehicle if row.own_autopilot else study.without_integrators()
    if not row.law:
        return load_profile(*row.profiles, vehicle=vehicle)
    sections = deepcopy(study.document["shared"])
    own = strength.get(row.law, ZERO)
    if row.common:
        own = _common(study, own)
    for subsystem in SUBSYSTEMS:
        node = f"{subsystem}_controller"
        part = sections[node] | study.document["law_parameters"]
        part |= _LAWS[row.law](study, subsystem, own[subsystem], row.frozen)
        if row.frozen == "converged":
            if gains is None:
                raise ValueError(f"row '{row.label}' needs the gains that it is frozen at")
            k, zeta = gains[subsystem][:4], gains[subsystem][4]
            part |= {"k_initial": np.maximum(k, NONE).tolist(), "zeta_initial": max(zeta, NONE)}
        sections[node] = part
    for name in row.profiles:
        for node, values in read_sections(configuration.named("profiles", name)).items():
            sections[node] = sections.get(node, {}) | values
    return profile_of(sections, Path(f"{row.label}.yaml"), vehicle)


def feedback(study: Study, subsystem: str) -> tuple[np.ndarray, np.ndarray, list[float]]:
    """Return bandwidth w (n,) [rad/s], lambda_1 (n,), and the inertia."""
    entry = study.document["feedback"][subsystem]
    w = np.array(entry["bandwidth"], dtype=float)
    return w, w**2, list(map(float, entry["inertia"]))


def _modular(study: Study, subsystem: str, g: float, frozen: str) -> dict[str, Any]:
    w, first, inertia = feedback(study, subsystem)
    second = 2.0 * w
    numbers = study.document["adaptation"][MODULAR]
    rate, layer = numbers[f"{subsystem}.rate"], numbers[f"{subsystem}.layer"]
    p12 = rate * first / first.max()
    values = {
        "law": MODULAR,
        "lambda_form": "theory",
        "lambda_table": [1.0] * len(w),  # printed gains, without effect
        **study.document["modular_parameters"],
        "inertia": inertia,
        "lambda_1": first.tolist(),
        "lambda_2": second.tolist(),
        "q_position": (2.0 * first * p12).tolist(),
        "q_velocity": (2.0 * (ADDED - 1.0) * p12).tolist(),
        "nu": [numbers["nu"]] * 4,
        "varpi": rate * layer,
    }
    most = g * first.max() * layer  # of rho: (rho / varpi) p12 = g lambda_1
    if frozen in ("zero", "margin"):
        values |= {"adapt": False, "k_initial": [NONE] * 4, "zeta_initial": NONE}
        values |= {"k_ceiling": [0.0] * 4}
        if frozen == "margin":
            values |= {
                "lambda_1": ((1.0 + g) * first).tolist(),
                "lambda_2": (second + ADDED * g * first / second).tolist(),
            }
        return values
    start = max(1e-4 * most, NONE)
    return values | {
        "adapt": frozen != "converged",
        "k_initial": [start] * 4,
        "zeta_initial": start,
        "epsilon": start,
        "k_ceiling": np.maximum(PARTS * most, 2.0 * start).tolist(),
    }


def _asmc1(study: Study, subsystem: str, g: float, frozen: str) -> dict[str, Any]:
    w, first, inertia = feedback(study, subsystem)
    numbers = study.document["adaptation"][ASMC1]
    share, layer = numbers[f"{subsystem}.switching"], numbers[f"{subsystem}.layer"]
    phi = layer * w
    return {
        "law": ASMC1,
        "inertia": inertia,
        "slope": w.tolist(),
        "damping": ((1.0 - share) * w).tolist(),
        "switching": (share * w * phi).tolist(),
        "boundary": phi.tolist(),
        "switching_form": "sat",
        # one number for all axes: that of the slowest
        "gamma": g * float(first.min()) * numbers["strength"],
        "disturbance_ceiling": 0.0,
    }


def _asmc2(study: Study, subsystem: str, g: float, frozen: str) -> dict[str, Any]:
    w, _, inertia = feedback(study, subsystem)
    n, tunnel = len(w), TUNNEL[subsystem]
    numbers = study.document["adaptation"][ASMC2]
    varpi = numbers[f"{subsystem}.layer"] * w.max() / tunnel**2
    most = g * w.max() * varpi * tunnel**2
    start = max(1e-4 * most, NONE)
    return {
        "law": ASMC2,
        "inertia": inertia,
        "rho_initial": [tunnel] * n,
        "rho_final": [tunnel] * n,
        "rho_rate": [0.5] * n,
        "kappa": w.tolist(),
        "surface_gain": w.tolist(),
        "theta_initial": [start] * 3,
        "theta_ceiling": np.maximum(SHARES * most, 2.0 * start).tolist(),
        "gamma": numbers["gamma"],
        "sigma": numbers[f"{subsystem}.sigma"],
        "varpi": varpi,
    }


_LAWS = {MODULAR: _modular, ASMC1: _asmc1, ASMC2: _asmc2}


def _common(study: Study, strength: Strength) -> dict[str, float]:
    """Return the strengths of ASMC-1 for one gamma in all subsystems: the smallest."""
    slowest = {name: feedback(study, name)[1].min() for name in SUBSYSTEMS}
    gamma = min(strength[name] * slowest[name] for name in SUBSYSTEMS)
    return {name: gamma / slowest[name] for name in SUBSYSTEMS}


def largest_gains(made: Profile) -> dict[str, np.ndarray]:
    """Return the adapted gains with the largest effect, for `stack_model`."""
    found = {}
    for subsystem in SUBSYSTEMS:
        p = made.sets[f"{subsystem}_controller"]
        if p.law == MODULAR and p.adapt:
            rho = float(np.dot(p.k_ceiling, (1.0, 1.0, 1.0, 10.0)))
            found[subsystem] = np.array([rho, 0.0, 0.0, 0.0, NONE])
        elif p.law == ASMC2:
            found[subsystem] = np.array([float(np.sum(p.theta_ceiling)), 0.0, 0.0])
    return found


@dataclass(frozen=True)
class LoopMargins:
    """Delay margin [s] and least distance of L from -1 [1] of every loop, at one load."""

    delay: dict[str, float]
    distance: dict[str, float]
    stable: bool

    @classmethod
    def of(cls, found: Analysis) -> LoopMargins:
        """Return the margins of an analysis; the setpoints together are a loop, too."""
        delay = {name: m.delay for name, (_, m) in found.loops.items()}
        distance = {name: 1.0 / m.peak for name, (_, m) in found.loops.items()}
        delay["setpoints"] = found.setpoint_delay
        return cls(delay, distance, found.stable)

    def share_of(self, plain: LoopMargins) -> float:
        """Return the smallest ratio of a margin to that of `plain`; 0 if not stable."""
        if not self.stable:
            return 0.0
        # a loop without a crossover stands any delay
        ratios = [self.delay[k] / limit for k, limit in plain.delay.items() if np.isfinite(limit)]
        ratios += [self.distance[k] / limit for k, limit in plain.distance.items()]
        return float(min(ratios))


def loop_margins(made: Profile, load: float, gains: Gains | None = None) -> LoopMargins:
    """Return the margins of a profile with a load [kg] at the tip."""
    vehicle = Vehicle.of(made.vehicle).changed({"variation.tip_mass": load})
    return LoopMargins.of(analyse(stack_model(made, vehicle, gains=gains)))


def strengths(
    study: Study, progress: Callable[[str], None] = lambda text: None
) -> dict[str, dict[str, float]]:
    """Return law → subsystem → the largest strength that leaves the margins of the study."""
    loads, least = study.document["margin_loads"], 1.0 - study.document["spend"]
    plain_row = Row("", MODULAR, "zero")
    plain = {m: loop_margins(profile(study, plain_row, {}), m) for m in loads}

    def share(law: str, strength: Strength) -> float:
        made = profile(study, Row("", law), {law: strength})
        gains = largest_gains(made)
        return min(loop_margins(made, m, gains).share_of(plain[m]) for m in loads)

    found: dict[str, dict[str, float]] = {}
    for law in _LAWS:
        each = {}
        for subsystem in SUBSYSTEMS:

            def alone(g: float, law: str = law, subsystem: str = subsystem) -> float:
                return share(law, ZERO | {subsystem: g})

            each[subsystem] = _largest(alone, least, *STRENGTHS, HALVINGS)
            progress(f"{law}, {subsystem}: strength {each[subsystem]:.3g}")

        def together(factor: float, law: str = law, each: Strength = each) -> float:
            return share(law, {name: factor * g for name, g in each.items()})

        factor = 1.0 if together(1.0) >= least else _largest(together, least, 0.1, 1.0, JOINT)
        found[law] = {name: float(f"{factor * g:.4g}") for name, g in each.items()}
        progress(f"{law}: {factor:.2f} of each together")
    return found


def _largest(
    share: Callable[[float], float], least: float, low: float, high: float, halvings: int
) -> float:
    """Return the largest argument in low..high with share >= least, by bisection of its log."""
    if share(low) < least:
        return low
    for _ in range(halvings):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if share(middle) >= least else (low, middle)
    return low
