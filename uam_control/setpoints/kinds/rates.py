"""Body rates and thrust: tau_q acts through the autopilot's rate loop."""

from __future__ import annotations

from uam_control.frames import swap_body
from uam_control.setpoints.attitude_target import RATES, UPRIGHT, AttitudeTarget
from uam_control.setpoints.kinds.desired import Desired


def rates_setpoint(desired: Desired) -> AttitudeTarget:
    """Return body rates (FRD) and thrust of `desired`; the attitude is ignored."""
    return AttitudeTarget(RATES, UPRIGHT, swap_body(desired.rates), desired.thrust)
