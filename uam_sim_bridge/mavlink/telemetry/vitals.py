"""Newest battery, estimator, sensor and processor state that the autopilot has reported."""

from __future__ import annotations

from dataclasses import dataclass

from uam_sim_bridge.mavlink.protocol.wire import Message
from uam_sim_bridge.mavlink.telemetry.autopilot_health import unhealthy
from uam_sim_bridge.mavlink.telemetry.battery import Battery, from_battery_status, from_sys_status


@dataclass
class Vitals:
    """Newest values; None before the first message.

    estimator_flags: ESTIMATOR_STATUS.flags; unhealthy: names of sensors; load: of the processor,
    0..1.
    """

    battery: Battery | None = None
    estimator_flags: int | None = None
    unhealthy: tuple[str, ...] = ()
    load: float | None = None

    def take(self, kind: str, m: Message) -> None:
        """Store BATTERY_STATUS, SYS_STATUS or ESTIMATOR_STATUS; other messages are ignored."""
        if kind == "BATTERY_STATUS" and m.id == 0:
            self.battery = from_battery_status(m)
        elif kind == "SYS_STATUS":
            self.unhealthy = unhealthy(
                m.onboard_control_sensors_present,
                m.onboard_control_sensors_enabled,
                m.onboard_control_sensors_health,
            )
            self.load = 1e-3 * m.load
            if self.battery is None or not self.battery.known:
                self.battery = from_sys_status(m)
        elif kind == "ESTIMATOR_STATUS":
            self.estimator_flags = m.flags
