"""The simulated battery of the stand-in: PX4's SIM_BAT_* (module battery_simulator)."""

from __future__ import annotations

from uam_sim_bridge.autopilot.params import Parameters


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
