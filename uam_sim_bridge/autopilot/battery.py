"""The simulated battery of the stand-in: PX4's SIM_BAT_* (module battery_simulator)."""

from enum import IntEnum

from uam_control.settings.plain_members import plain_members
from uam_sim_bridge.autopilot.params import Parameters


@plain_members
class ChargeState(IntEnum):
    """MAV_BATTERY_CHARGE_STATE: the values in use. `LOW` and worse are PX4's warnings."""

    UNDEFINED = 0
    OK = 1
    LOW = 2
    CRITICAL = 3
    EMERGENCY = 4


class SimulatedBattery:
    """The state of charge falls linearly while armed. `charge`: 0..1, None if not simulated."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._full_since: float | None = None  # [s]
        self.charge: float | None = None

    def update(self, time: float, armed: bool) -> None:
        """Advance to `time` [s]."""
        p = self._parameters
        if not p["SIM_BAT_ENABLE"]:
            self.charge = self._full_since = None
            return
        if not armed or self._full_since is None:
            self._full_since = time
        used = (time - self._full_since) / p["SIM_BAT_DRAIN"]
        self.charge = max(1.0 - used, 0.01 * p["SIM_BAT_MIN_PCT"])

    @property
    def state(self) -> ChargeState:
        """Return the state that the charge has by BAT_LOW_THR, BAT_CRIT_THR, BAT_EMERGEN_THR."""
        p, charge = self._parameters, self.charge
        if charge is None:
            return ChargeState.UNDEFINED
        if charge < p["BAT_EMERGEN_THR"]:
            return ChargeState.EMERGENCY
        if charge < p["BAT_CRIT_THR"]:
            return ChargeState.CRITICAL
        return ChargeState.LOW if charge < p["BAT_LOW_THR"] else ChargeState.OK
