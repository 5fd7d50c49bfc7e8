"""Texts and rows of stability.json for the page."""

from collections.abc import Mapping
from typing import Any

from uam_lab.records.results.timeseries import SUBSYSTEMS

LOOSE = 0.1  # V / bound; below it the page calls the bound loose


def rows(found: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return one row of texts per subsystem."""
    return [_row(name, found[name]) for name in SUBSYSTEMS]


def verdict(found: Mapping[str, Any]) -> str:
    """Return a text: fraction of the ticks with V within its bounds, and how tight they are."""
    whole = found["V"]
    inside = min(whole["within_bound"], *(found[n]["V"]["within_bound"] for n in SUBSYSTEMS))
    envelope = min(
        whole["within_envelope"], *(found[n]["V"]["within_envelope"] for n in SUBSYSTEMS)
    )
    ratio = whole["largest_ratio_to_bound"]
    step = min(found[n]["step_inequality_holds"] for n in SUBSYSTEMS)
    loose = ": the bound holds, but it is loose" if inside == 1.0 and ratio < LOOSE else ""
    return (
        f"V and each V_j are within the ultimate bound at {_percent(inside)} and within the "
        f"solution of the differential inequality at {_percent(envelope)} of "
        f"{found['ticks']} airborne ticks. "
        f"The largest V is {_number(ratio)} of its bound{loose}. "
        "The sharper inequality for dV_j/dt, without the division by the largest eigenvalue "
        f"of P_j, holds at {_percent(step, 2)} of the ticks."
    )


def caveats(found: Mapping[str, Any]) -> list[str]:
    """Return the measured assumptions of the proof, one sentence each."""
    a = found["assumptions"]
    radius, norm = a["mass_matrix"]["radius"], a["mass_matrix"]["norm"]
    ceilings = {name: max(a["at_ceiling"][name]) for name in SUBSYSTEMS}
    seen = [a["acceleration"][name]["below_true"] for name in SUBSYSTEMS]
    return [
        f"Mbar and M: the spectral radius of I − M⁻¹ Mbar reaches {radius:.2f} (below 1 the "
        "acceleration that tau causes feeds back with a factor below 1); ‖I − M_jj Mbar_j⁻¹‖ is "
        + _list(norm, "{:.2f}")
        + ".",
        "Acceleration: because of estimate, limit and filter, ‖chi_ddot‖ in rho_j was below the "
        f"true value at {_percent(max(seen))} of the ticks.",
        "tau was at a limit at " + _list(a["saturated"], "{:.1f} %", 100.0) + " of the ticks.",
        "A gain was at its ceiling at " + _list(ceilings, "{:.1f} %", 100.0) + " of the ticks.",
        f"Estimator: ‖xi‖ is {_number(a['estimator']['rms_xi'])} RMS, the error of its estimate "
        f"{_number(a['estimator']['rms_error'])}.",
        f"Attitude error: e_q_dot is the derivative of e_q to within {_percent(a['error_rate'])}.",
    ]


def _row(name: str, one: Mapping[str, Any]) -> dict[str, str]:
    value, shares = one["V"], one["coupling"]
    met = (("adaptive_share", "adaptive"), ("feedback_share", "feedback"),
           ("integral_share", "integral action"), ("actuators_share", "actuators"))  # fmt: skip
    terms = [f"{text} {_percent(shares[key], 0)}" for key, text in met if shares[key] is not None]
    return {
        "name": name,
        "value": _number(value["max"]),
        "bound": _number(max(value["start"], value["bound"])),
        "error": _number(one["xi_max"]),
        "error_bound": _number(one["xi_bound"]),
        "constants": ", ".join(_number(k) for k in one["K_star"]),
        "supplied": ", ".join(terms),
    }


def _list(values: Mapping[str, float], form: str, factor: float = 1.0) -> str:
    return ", ".join(f"{form.format(factor * values[name])} ({name})" for name in SUBSYSTEMS)


def _number(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.0f}" if 100.0 <= abs(value) < 1e5 else f"{value:.3g}"


def _percent(fraction: float, digits: int = 1) -> str:
    return f"{100.0 * fraction:.{digits}f} %"
