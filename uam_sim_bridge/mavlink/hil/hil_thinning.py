"""Reduces the rate of HIL_SENSOR to what a serial line carries beside setpoints and vision."""

from __future__ import annotations

import math

from uam_sim_bridge.mavlink.protocol.wire import Message

SENSOR_BYTES, SETPOINT_BYTES, VISION_BYTES = 77, 51, 129  # longest frames on the line
FULL_RATE, VISION_RATE = 250.0, 50.0  # Hz, of the control ticks and of vision poses
LEAST_RATE = 50.0  # Hz, lowest sensor rate with which a flight controller flies
USABLE = 0.8  # of the line's rate; above it frames wait in the queue


def sustainable_rate(bytes_per_second: float | None) -> float:
    """Return the rate [Hz] of HIL_SENSOR that a line carries, at most FULL_RATE.

    bytes_per_second: None for a line without limit. Raises ValueError below LEAST_RATE.
    """
    if bytes_per_second is None:
        return FULL_RATE
    others = FULL_RATE * SETPOINT_BYTES + VISION_RATE * VISION_BYTES
    rate = (USABLE * bytes_per_second - others) / SENSOR_BYTES
    if rate < LEAST_RATE:
        needed = (LEAST_RATE * SENSOR_BYTES + others) / USABLE
        raise ValueError(
            f"{bytes_per_second:.0f} bytes/s do not carry setpoints, vision and "
            f"sensors, {needed:.0f} are needed; or choose --hil-rate"
        )
    return min(FULL_RATE, rate)


class Thinner:
    """Passes HIL_SENSOR at a rate, with the `fields_updated` of the dropped messages included."""

    def __init__(self, rate: float) -> None:
        """rate [Hz], in the time of the sensor messages."""
        self._interval = 1e6 / rate
        self._due = -math.inf
        self._last = -math.inf
        self._fields = 0

    def take(self, message: Message) -> bool:
        """Return whether the message passes; its `fields_updated` then covers the dropped ones."""
        stamp = message.time_usec
        self._fields |= message.fields_updated
        if stamp < self._last:  # the simulator has restarted
            self._due = -math.inf
        self._last = stamp
        if stamp < self._due - 1.0:
            return False
        following = self._due + self._interval
        self._due = following if following > stamp else stamp + self._interval
        message.fields_updated, self._fields = self._fields, 0
        return True
