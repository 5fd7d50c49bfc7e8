"""The cases of the margins: without and with payload, with initial and with flown gains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from uam_control.laws.modular import ZETA
from uam_control.profiles.profile import Profile
from uam_lab.experiments.margins.loops import analyse, fastest_mode
from uam_lab.experiments.margins.report import Case
from uam_lab.experiments.margins.stack_model import stack_model
from uam_lab.records.results.timeseries import SUBSYSTEMS
from uam_sim_bridge.plant import Vehicle

INITIAL, FLOWN = "initial gains", "flown gains"


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
