"""The autopilot's clock, from TIMESYNC, and its IMU as a sensor with stamps of the companion.

Clock offset, round trip and restarts; the companion's side.

A request carries the companion's time; the answer repeats it and adds the autopilot's time. The
autopilot is assumed to read its clock at the middle of the round trip, so the error is at most half
of it: short round trips get a higher weight. Times are those of the companion's clock; where that
is the clock of the ticks, round trips have a resolution of one tick.

HIGHRES_IMU → samples in FLU. PX4 v1.16 sends the selected IMU, integrated over IMU_INTEG_RATE
(200 Hz by default) and without the estimated biases; time_usec is the sample's time since boot.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from uam_control.frames import swap_body
from uam_sim_bridge.mavlink.protocol.wire import Message, mavlink2

PERIOD = 0.2  # s between two requests
JUMP = 0.1  # s of offset error beyond half the round trips: one of the clocks has jumped
JUMPS_TO_RESET = 2  # in a row: a single one may be a damaged answer
_OUTSTANDING = 16  # newest requests whose answers are accepted
_RECENT = 25  # answers, window of the shortest round trip for the weights
_SLOWEST_GAIN = 0.05  # lowest gain of the averages
_SHORTEST = 1e-3  # s, lower bound of a round trip in the weights
_NEWEST = 5  # answers of one second
BACKWARDS = 1.0  # s: a smaller step back may be messages out of order
BEHIND = 5  # messages in a row that show a reboot
HIGHRES_IMU = mavlink2.MAVLINK_MSG_ID_HIGHRES_IMU
SLEW = 50_000  # [ns] per sample: 1 % of the time at 250 Hz
FRESH = 0x3F  # fields_updated: accelerometer and gyroscope
STORED = 32  # newest samples
_WRAP = 2**32 * 1e-3  # s, period of a 32-bit time in milliseconds: 49.7 days


class TimeSync:
    """Creates the TIMESYNC requests and estimates the offset from the answers."""

    def __init__(self) -> None:
        self.delivered = math.inf  # [s] when the newest answered request was sent
        self._requested: deque[int] = deque(maxlen=_OUTSTANDING)
        self._last = -math.inf
        self.restart()

    def restart(self) -> None:
        """Discard the estimate, for a new or rebooted autopilot."""
        self.offset: float | None = None  # [s] autopilot's clock − companion's clock
        self.round_trip: float | None = None  # [s] smoothed
        self._count = self._jumps = 0
        self._recent: deque[float] = deque(maxlen=_RECENT)

    @property
    def quickest(self) -> float | None:
        """Return the shortest round trip [s] of the last _NEWEST answers; None with fewer answers.

        The minimum ignores a single late answer but shows a slow link within a second.
        """
        newest = list(self._recent)[-_NEWEST:]
        return min(newest) if len(newest) == _NEWEST else None

    def request(self, time: float) -> int | None:
        """Return ts1 [ns] of the request due at `time` [s]; None if none is due."""
        if time - self._last < PERIOD - 1e-9:
            return None
        self._last = time
        ts1 = nanoseconds(time)
        self._requested.append(ts1)
        return ts1

    def answer(self, time: float, tc1: int, ts1: int) -> None:
        """Process an answer received at `time` [s].

        tc1: autopilot's time [ns]; ts1: time of the request [ns]. Answers to other requests are
        ignored. A jump of the offset is no restart of the autopilot: on a busy machine the ticks
        fall behind and catch up again.
        """
        if ts1 not in self._requested:
            return
        self._requested.remove(ts1)
        self.delivered = ts1 * 1e-9
        asked = ts1 * 1e-9
        if time < asked - BACKWARDS:  # the companion's clock went back: a new simulation
            self.restart()
            return
        time = max(time, asked)  # an answer in the tick of its request is early by rounding
        round_trip = time - asked
        offset = tc1 * 1e-9 - (asked + time) / 2.0
        # the estimate may be wrong by half its round trip, too: the first answers may be slow
        unsure = (round_trip + (self.round_trip or 0.0)) / 2.0
        if self.offset is not None and abs(offset - self.offset) > JUMP + unsure:
            self._jumps += 1
            if self._jumps < JUMPS_TO_RESET:
                return
            self.restart()
        self._jumps = 0
        self._take(offset, round_trip)

    def _take(self, offset: float, round_trip: float) -> None:
        self._count += 1
        self._recent.append(max(round_trip, _SHORTEST))
        gain = max(1.0 / self._count, _SLOWEST_GAIN)
        if self.offset is None or self.round_trip is None:
            self.offset, self.round_trip = offset, round_trip
            return
        self.round_trip += gain * (round_trip - self.round_trip)
        # the offset error is at most half the round trip: weight by the inverse square
        weight = (min(self._recent) / self._recent[-1]) ** 2
        self.offset += gain * weight * (offset - self.offset)


def nanoseconds(time: float) -> int:
    """Return `time` [s] in TIMESYNC's unit [ns], at least 1: tc1 = 0 marks a request."""
    return max(1, round(time * 1e9))


class RebootDetector:
    """Compares successive times since boot of ATTITUDE_QUATERNION and TIMESYNC.

    A reboot is BEHIND messages in a row that are older than the latest by BACKWARDS, in order among
    themselves: packets that come late, between newer ones, are none.
    """

    def __init__(self) -> None:
        self._latest: float | None = None
        self._behind: list[float] = []

    def time_since_boot(self, time: float) -> bool:
        """Return True if `time` [s since boot] shows a restart."""
        latest = self._latest
        if latest is None or latest - time < BACKWARDS:
            self._latest = time if latest is None else max(time, latest)
            self._behind.clear()
            return False
        if self._behind and not 0.0 <= time - self._behind[-1] < BACKWARDS:
            self._behind.clear()
        self._behind.append(time)
        if len(self._behind) < BEHIND:
            return False
        self._behind.clear()
        self._latest = time
        return latest - time < _WRAP - 60.0


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
