"""The pilot's ground station and radio in a rehearsal with PX4: without them PX4 does not arm.

PX4 as a vehicle needs it (config/px4/vehicle.yaml) requires the heartbeat of a ground station, a
radio or joystick, and a global position, whose origin the ground station sets. An origin that comes
before EKF2's height is valid loses its altitude, and PX4 does not arm: it is sent until PX4
reports it complete.
"""

from __future__ import annotations

from uam_sim_bridge.mavlink.protocol.wire import Message, mavlink2

SYSTEM, COMPONENT = 255, 190  # of a ground station
HEARTBEAT_PERIOD, STICKS_PERIOD = 1.0, 0.05  # [s]; PX4 regards sticks as lost after 0.5 s
ORIGIN_PERIOD = 2.0  # [s] until PX4 reports the origin complete
CENTRED = 500  # throttle of MANUAL_CONTROL, 0 to 1000
# of the room: any place will do; the same as that of the simulated magnetometer and barometer
LATITUDE, LONGITUDE, ALTITUDE = 473977420, 85455940, 488000  # [1e-7 deg], [mm]
NEAR = 100, 100, 1000  # differences of a reported origin, in the same units: PX4 rounds


class GroundStation:
    """Sends heartbeats, centred sticks and the origin; `origin_known`: PX4 has it."""

    def __init__(self, autopilot: int = 1) -> None:
        """autopilot: its MAVLink system id."""
        self._autopilot = autopilot
        self.origin_known = False
        self._next = dict.fromkeys(("heartbeat", "sticks", "origin"), 0.0)

    def due(self, now: float) -> list[Message]:
        """Return the messages to send at `now` [s]."""
        found = []
        if self._at("heartbeat", now, HEARTBEAT_PERIOD):
            kind, none = mavlink2.MAV_TYPE_GCS, mavlink2.MAV_AUTOPILOT_INVALID
            active = mavlink2.MAV_STATE_ACTIVE
            found.append(mavlink2.MAVLink_heartbeat_message(kind, none, 0, 0, active, 3))
        if self._at("sticks", now, STICKS_PERIOD):
            found.append(
                mavlink2.MAVLink_manual_control_message(self._autopilot, 0, 0, CENTRED, 0, 0)
            )
        if not self.origin_known and self._at("origin", now, ORIGIN_PERIOD):
            found.append(
                mavlink2.MAVLink_set_gps_global_origin_message(
                    self._autopilot, LATITUDE, LONGITUDE, ALTITUDE
                )
            )
        return found

    def take(self, message: Message) -> None:
        """Take a message of the autopilot; a complete origin stays known."""
        if message.get_type() != "GPS_GLOBAL_ORIGIN" or self.origin_known:
            return
        reported = message.latitude, message.longitude, message.altitude
        sent = LATITUDE, LONGITUDE, ALTITUDE
        self.origin_known = all(
            abs(has - given) <= near for has, given, near in zip(reported, sent, NEAR, strict=True)
        )

    def _at(self, what: str, now: float, period: float) -> bool:
        """Return whether `what` is due, at most once per `period` [s]."""
        if now < self._next[what]:
            return False
        self._next[what] = now + period
        return True
