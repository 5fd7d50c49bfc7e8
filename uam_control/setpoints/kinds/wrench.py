"""Torque and thrust as the laws command them: no loop of the autopilot acts on the attitude."""

from __future__ import annotations

import numpy as np

from uam_control.frames import swap_body
from uam_control.setpoints.kinds.desired import Desired, Target
from uam_control.setpoints.kinds.rates import rates_setpoint
from uam_control.setpoints.wrench_target import WrenchTarget


def wrench_setpoint(desired: Desired) -> Target:
    """Return torque (FRD) and thrust of `desired`; body rates where no law commands a torque."""
    if desired.torque is None:
        return rates_setpoint(desired)
    return WrenchTarget(swap_body(np.clip(desired.torque, -1.0, 1.0)), desired.thrust)
