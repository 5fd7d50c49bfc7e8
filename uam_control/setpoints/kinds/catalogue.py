"""Every setpoint type by its name. A new one is a file beside this one and a line in SETPOINTS."""

from __future__ import annotations

from dataclasses import dataclass

from uam_control.setpoints.kinds.attitude import attitude_setpoint
from uam_control.setpoints.kinds.desired import SetpointType
from uam_control.setpoints.kinds.position import position_setpoint
from uam_control.setpoints.kinds.rates import rates_setpoint
from uam_control.setpoints.kinds.wrench import wrench_setpoint
from uam_control.settings.parameter_set import ParameterSet, choice, number

SETPOINTS: dict[str, SetpointType] = {
    "rates": rates_setpoint,
    "attitude": attitude_setpoint,
    "position": position_setpoint,
    "wrench": wrench_setpoint,
}


@dataclass(frozen=True)
class SetpointParameters(ParameterSet):
    """Type of the setpoints that the bridge sends."""

    setpoint: str = choice(
        "rates",
        "what is sent: rates, attitude or wrench (torque) with the thrust, or position; only rates "
        "and wrench act as tau_q",
        tuple(SETPOINTS),
    )

    setpoint_rate: float = number(
        0.0,
        "rate of new setpoints; in between the last one is repeated; 0 = every tick",
        "Hz",
        0.0,
        1e3,
    )

    @property
    def type(self) -> SetpointType:
        """The function that makes the setpoints."""
        return SETPOINTS[self.setpoint]
