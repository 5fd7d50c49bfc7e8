"""The cases of the margins: without and with payload, with initial and with flown gains.

And whether a vehicle has the margins that the profile which flies it counts on: the supervisor's
limit of late setpoints is the profile's `delay_margin`, with less in the vehicle it acts too late.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uam_control.laws import catalogue
from uam_control.laws.modular import ZETA
from uam_control.profiles.profile import Profile
from uam_control.vehicle import CURRENT_SERVO
from uam_lab.experiments.margins.loops import Analysis, GrowingMode, analyse, fastest_mode
from uam_lab.experiments.margins.stack_model import MODELLED, Stack, stack_model
from uam_lab.records.results.timeseries import SUBSYSTEMS, Series, gain_columns
from uam_sim_bridge.plant import Vehicle

INITIAL, FLOWN = "initial gains", "flown gains"
TOLERANCE = 1.05  # ratio of the profile's delay_margin to that of the vehicle
PERCENTILE = 95.0  # of an adapted gain along a flight
LEAST_GAIN, MOST_PEAK = 3.0, 4.0  # [dB]; largest sensitivity


@dataclass(frozen=True)
class Case:
    """One operating point."""

    label: str  # payload and gains
    stack: Stack
    analysis: Analysis
    rho: dict[str, float]  # effective gain rho of each subsystem
    sliding: GrowingMode  # the fastest mode without dry friction of the joints


def smallest_delay(cases: Sequence[Case]) -> tuple[float, str]:
    """Return the smallest delay margin [s] of the setpoint path, and the label of its case."""
    worst = min(cases, key=lambda case: case.analysis.setpoint_delay)
    return worst.analysis.setpoint_delay, worst.label


def cases_of(
    profile: Profile,
    vehicle: Vehicle,
    payloads: Sequence[float],
    flown: Mapping[str, np.ndarray] | None = None,
    arm: Sequence[float] | None = None,
    late_setpoints: int = 0,
) -> list[Case]:
    """Return the analysed cases: each payload [kg] with the initial gains and, if given, `flown`.

    arm (n,) [rad], late_setpoints [ticks]: see `stack_model`.
    """
    found = []
    for gains, name in ((None, INITIAL), (flown, FLOWN))[: 1 if flown is None else 2]:
        for payload in payloads:
            stack = stack_model(profile, vehicle, payload, arm, gains, late_setpoints)
            label = f"{payload:g} kg, {name}" if payload else f"no payload, {name}"
            sliding = stack_model(profile, vehicle, payload, arm, gains, late_setpoints, dry=False)
            mode = fastest_mode(sliding)
            found.append(Case(label, stack, analyse(stack), rho_of(profile, gains), mode))
    return found


def rho_of(profile: Profile, gains: Mapping[str, np.ndarray] | None) -> dict[str, float]:
    """Return rho at rest of each subsystem with the modular law: K0 + zeta."""
    found = {}
    for subsystem in SUBSYSTEMS:
        parameters = profile.sets[f"{subsystem}_controller"]
        if not hasattr(parameters, "k_initial"):
            continue
        if gains and subsystem in gains:
            found[subsystem] = float(gains[subsystem][0] + gains[subsystem][ZETA])
        else:
            found[subsystem] = parameters.k_initial[0] + parameters.zeta_initial
    return found


def judged(profile: Profile) -> bool:
    """Return whether the model has the profile's setpoints: body rates or torques of the base, and
    torques of the joints."""
    servos = profile.sets["arm_controller"].setpoint
    return profile.setpoint in MODELLED and servos == CURRENT_SERVO


def missed(profile: Profile, payloads: Sequence[float]) -> tuple[str, ...]:
    """Return a line per payload [kg] with which the profile's vehicle lacks its margins, stowed,
    with the initial gains."""
    if not judged(profile):
        return ()
    cases = cases_of(profile, Vehicle.of(profile.vehicle), payloads)
    stated = profile.sets["mission"].delay_margin
    about = f"profile {profile.name} on {profile.vehicle.name}"
    return tuple(
        f"{about}, {case.label}: {'; '.join(lines)}"
        for case in cases
        if (lines := _missed(case, stated))
    )


def _missed(case: Case, stated: float) -> list[str]:
    found: Analysis = case.analysis
    if not found.stable:
        mode = found.mode
        return [f"unstable, {mode.growth:.2g} 1/s at {mode.frequency:.3g} rad/s"]
    lines = []
    if stated > TOLERANCE * found.setpoint_delay:
        delay = f"{1e3 * found.setpoint_delay:.0f} ms"
        lines.append(f"delay margin {delay}, delay_margin of the mission {1e3 * stated:.0f} ms")
    for loop, (_, one) in found.loops.items():
        if min(one.gain, one.gain_down) < LEAST_GAIN or one.peak > MOST_PEAK:
            gain = min(one.gain, one.gain_down)
            lines.append(f"{loop}: gain margin {gain:.1f} dB, sensitivity {one.peak:.1f}")
    return lines


def flown_gains(profile: Profile, series: Series) -> dict[str, np.ndarray]:
    """Return the gains of each subsystem in a flight, for the model.

    The modular law has the gain rho / max(||r||, varpi) on r, the model rho / varpi: its rho is the
    95th percentile of rho varpi / max(||r||, varpi) in flight. K0 alone gives it, because the other
    terms depend on the motion. Of the other laws each gain is the median.
    """
    found = {}
    for subsystem in SUBSYSTEMS:
        parameters = profile.sets[f"{subsystem}_controller"]
        names = catalogue.law(parameters.law).gain_names(len(parameters.inertia))
        rows = series.values[series.flown][:, gain_columns(subsystem, names, series.columns)]
        rows = rows[np.isfinite(rows).all(axis=1)]
        if not len(rows):
            continue
        if parameters.law != catalogue.DEFAULT:
            found[subsystem] = np.median(rows, axis=0)
            continue
        zeta = float(np.median(rows[:, ZETA]))
        layer = np.maximum(rows[:, names.index("r_norm")] / parameters.varpi, 1.0)
        rho = float(np.percentile(rows[:, names.index("rho")] / layer, PERCENTILE))
        found[subsystem] = np.array([max(rho - zeta, 0.0), 0.0, 0.0, 0.0, zeta])
    return found


def verdict(stated: float, computed: float) -> str:
    """Return how the profile's delay_margin [s] compares with the computed margin [s]."""
    if stated > TOLERANCE * computed:
        return f"too large: computed {computed:.4f} s"
    if stated < computed / TOLERANCE / TOLERANCE:
        return f"smaller than necessary: computed {computed:.4f} s"
    return "as computed"
