"""Whether a vehicle has the margins that the profile which flies it counts on.

The supervisor's limit of late setpoints is the profile's `delay_margin`: with less in the vehicle
it acts too late. The model is that of `uam margins`, stowed, with the initial gains.
"""

from __future__ import annotations

from collections.abc import Sequence

from uam_control.profiles.profile import Profile
from uam_control.vehicle import CURRENT_SERVO
from uam_lab.experiments.margins.cases import cases_of
from uam_lab.experiments.margins.loops import Analysis
from uam_lab.experiments.margins.report import Case
from uam_lab.experiments.margins.stack_model import MODELLED
from uam_sim_bridge.plant import Vehicle

TOLERANCE = 1.05  # ratio of the profile's delay_margin to that of the vehicle
LEAST_GAIN, MOST_PEAK = 3.0, 4.0  # [dB]; largest sensitivity


def judged(profile: Profile) -> bool:
    """Return whether the model has the profile's setpoints: body rates or torques of the base, and
    torques of the joints."""
    servos = profile.sets["arm_controller"].setpoint
    return profile.setpoint in MODELLED and servos == CURRENT_SERVO


def missed(profile: Profile, payloads: Sequence[float]) -> tuple[str, ...]:
    """Return a line per payload [kg] with which the profile's vehicle lacks its margins."""
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
