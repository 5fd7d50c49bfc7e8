"""Body rates and thrust: tau_q acts through the autopilot's rate loop."""

from __future__ import annotations

from uam_sim_bridge.mavlink.offboard.setpoints.desired import Desired
from uam_sim_bridge.mavlink.protocol.attitude_target import RATES, UPRIGHT, AttitudeTarget
from uam_sim_bridge.mavlink.protocol.frames import swap_body


def rates_setpoint(desired: Desired) -> AttitudeTarget:
    """Return body rates (FRD) and thrust of `desired`; the attitude is ignored."""
    return AttitudeTarget(RATES, UPRIGHT, swap_body(desired.rates), desired.thrust)
