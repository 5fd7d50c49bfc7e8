"""stability.json in words and rows for the page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from uam_lab.results.timeseries import SUBSYSTEMS

LOOSE = 0.1  # of its bound that V fills at most for the bound to say little


@dataclass(frozen=True)
class StabilityRow:
    """One subsystem as text: V and its bound, error and what the bound leaves, K*, who supplies."""

    name: str
    value: str
    bound: str
    error: str
    error_bound: str
    constants: str
    supplied: str


def rows(found: Mapping[str, Any]) -> list[StabilityRow]:
    """One per subsystem."""
    return [_row(name, found[name]) for name in SUBSYSTEMS]


def verdict(found: Mapping[str, Any]) -> str:
    """Whether V stayed within its bound, and how tight that is."""
    whole = found["V"]
    inside = min(whole["within_bound"], *(found[n]["V"]["within_bound"] for n in SUBSYSTEMS))
    envelope = min(
        whole["within_envelope"], *(found[n]["V"]["within_envelope"] for n in SUBSYSTEMS)
    )
    ratio = whole["largest_ratio_to_bound"]
    step = min(found[n]["step_inequality_holds"] for n in SUBSYSTEMS)
    loose = ": it holds, but says little" if inside == 1.0 and ratio < LOOSE else ""
    return (
        f"V and each V_j stayed within the ultimate bound at {_percent(inside)} and within what "
        f"the differential inequality allows until then at {_percent(envelope)} of "
        f"{found['ticks']} ticks in the air. "
        f"The largest V is {_number(ratio)} of its bound{loose}. "
        "The sharper inequality for dV_j/dt, before the proof divides by the largest eigenvalue "
        f"of P_j, holds at {_percent(step, 2)} of the ticks."
    )


def caveats(found: Mapping[str, Any]) -> list[str]:
    """What the proof assumes, measured, one sentence each."""
    a = found["assumptions"]
    radius, norm = a["mass_matrix"]["radius"], a["mass_matrix"]["norm"]
    ceilings = {name: max(a["at_ceiling"][name]) for name in SUBSYSTEMS}
    seen = [a["acceleration"][name]["below_true"] for name in SUBSYSTEMS]
    return [
        f"Mbar and M: the spectral radius of I − M⁻¹ Mbar reaches {radius:.2f} (below 1 the "
        "acceleration that tau causes feeds back with a factor below 1); ‖I − M_jj Mbar_j⁻¹‖ is "
        + _list(norm, "{:.2f}")
        + ".",
        f"Acceleration: the ‖chi_ddot‖ that K3 sees was below the true one at {_percent(max(seen))}"
        " of the ticks: estimate, limit and filter lie between.",
        "Limits cut tau at " + _list(a["saturated"], "{:.1f} %", 100.0) + " of the ticks.",
        "A ceiling held a gain down at " + _list(ceilings, "{:.1f} %", 100.0) + " of the ticks.",
        f"Estimator: ‖xi‖ is {_number(a['estimator']['rms_xi'])} RMS, the error of its estimate "
        f"{_number(a['estimator']['rms_error'])}.",
        f"Attitude error: e_q_dot is the derivative of e_q to within {_percent(a['error_rate'])}.",
    ]


def _row(name: str, one: Mapping[str, Any]) -> StabilityRow:
    value, shares = one["V"], one["coupling"]
    met = (("adaptive_share", "adaptive"), ("feedback_share", "feedback"),
           ("actuators_share", "actuators"))  # fmt: skip
    return StabilityRow(
        name=name,
        value=_number(value["max"]),
        bound=_number(max(value["start"], value["bound"])),
        error=_number(one["xi_max"]),
        error_bound=_number(one["xi_bound"]),
        constants=", ".join(_number(k) for k in one["K_star"]),
        supplied=", ".join(
            f"{label} {_percent(shares[key], 0)}" for key, label in met if shares[key] is not None
        ),
    )


def _list(values: Mapping[str, float], form: str, factor: float = 1.0) -> str:
    return ", ".join(f"{form.format(factor * values[name])} ({name})" for name in SUBSYSTEMS)


def _number(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.0f}" if 100.0 <= abs(value) < 1e5 else f"{value:.3g}"


def _percent(fraction: float, digits: int = 1) -> str:
    return f"{100.0 * fraction:.{digits}f} %"
