"""The autopilot's IMU as a sensor: HIGHRES_IMU → samples in FLU with stamps of the companion.

PX4 v1.16 sends the selected IMU, integrated over IMU_INTEG_RATE (200 Hz by default) and without the
estimated biases; time_usec is the sample's time since boot.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from uam_control.frames import swap_body
from uam_sim_bridge.mavlink.protocol.wire import Message, mavlink2
from uam_sim_bridge.mavlink.telemetry.time_sync import TimeSync

SLEW = 50_000  # [ns] per sample: 1 % of the time at 250 Hz
NUMBER = mavlink2.MAVLINK_MSG_ID_HIGHRES_IMU
FRESH = 0x3F  # fields_updated: accelerometer and gyroscope
STORED = 32  # newest samples


class ClockMap:
    """Follows the offset of `TimeSync` by at most SLEW per sample.

    The first answers over a slow link may be wrong by many milliseconds. A better one must not let
    the stamps go back.
    """

    def __init__(self, sync: TimeSync) -> None:
        self._sync = sync
        self._offset: int | None = None  # [ns] autopilot's clock - companion's clock

    def companion(self, stamp: int) -> int | None:
        """Return the stamp [ns] of a sample in the companion's clock; stamp: the autopilot's [ns].

        None before five answers, and after a reboot until there are five again.
        """
        sync = self._sync
        if sync.offset is None or sync.quickest is None:
            self._offset = None
            return None
        measured = round(sync.offset * 1e9)
        if self._offset is None:
            self._offset = measured
        self._offset += max(-SLEW, min(SLEW, measured - self._offset))
        return stamp - self._offset


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
