"""The autopilot's IMU as a sensor: HIGHRES_IMU → samples in FLU with stamps of the companion.

PX4 v1.16 sends the selected IMU, integrated over IMU_INTEG_RATE (200 Hz by default) and without the
estimated biases; time_usec is the sample's time since boot.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from uam_control.frames import swap_body
from uam_sim_bridge.mavlink.protocol.wire import Message, mavlink2
from uam_sim_bridge.mavlink.telemetry.clock_map import ClockMap
from uam_sim_bridge.mavlink.telemetry.time_sync import TimeSync

NUMBER = mavlink2.MAVLINK_MSG_ID_HIGHRES_IMU
FRESH = 0x3F  # fields_updated: accelerometer and gyroscope
STORED = 32  # newest samples


class ImuSample(NamedTuple):
    """stamp [ns] of the companion's clock; gyro (3,) [rad/s], force (3,) [m/s^2], FLU."""

    stamp: int
    gyro: np.ndarray
    force: np.ndarray


class AutopilotImu:
    """Samples of the autopilot's IMU; `refused`: those that cannot be used.

    Nothing is delivered before the clocks are related, nor after a reboot until they are again.
    """

    def __init__(self, sync: TimeSync) -> None:
        """sync: relates the two clocks, see `ClockMap`."""
        self._clocks = ClockMap(sync)
        self._samples: deque[ImuSample] = deque(maxlen=STORED)
        self.refused = 0

    def take(self, m: Message) -> None:
        """Store the sample of a HIGHRES_IMU."""
        gyro = np.array([m.xgyro, m.ygyro, m.zgyro])
        force = np.array([m.xacc, m.yacc, m.zacc])
        fresh = m.fields_updated & FRESH == FRESH and m.id == 0
        if not fresh or not math.isfinite(gyro.sum() + force.sum()):
            self.refused += 1
            return
        stamp = self._clocks.companion(1000 * m.time_usec)
        if stamp is not None:
            self._samples.append(ImuSample(stamp, swap_body(gyro), swap_body(force)))

    def samples(self) -> list[ImuSample]:
        """Remove and return the stored samples, in order."""
        found = list(self._samples)
        self._samples.clear()
        return found
