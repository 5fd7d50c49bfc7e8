"""Frames of a tracking system → stamped poses of vehicle and payload, and the health of both."""

import math
import time
from collections import deque
from enum import Enum
from typing import NamedTuple

import numpy as np

from uam_control.stamps import SECOND
from uam_sim_bridge.devices.mocap.calibration import Calibration
from uam_sim_bridge.devices.mocap.frame import Frame, MocapError, MocapSource, unknown_body
from uam_sim_bridge.devices.mocap.mocap_parameters import MocapParameters

RESTART = 240  # frames back, two seconds at 120 Hz: the server counts anew
START_TIME = 3.0  # [s] for a server that is there to send the list of its bodies
WINDOW = 240  # frames of the latency that is reported
LATEST = SECOND  # [ns] a pose that is older was stamped by a clock that was set
BLOCK = 1.0  # [s] of messages between the clocks: each contributes its lowest point
BLOCKS = 20  # window of the line through these
FEWEST = 5  # blocks for a drift
DRIFT_MAX = 5e-4  # crystals differ by 1e-4, NTP steers by 5e-4 at most
JUMP = 0.1  # [s] a clock that was set, or a server that was restarted


class ClockOffset:
    """Offset and drift between the server's clock and the host's, from one-way messages.

    arrival − sent = offset + delay of the network, and the delay is never below its least value.
    The lowest points of arrival − sent over a window therefore lie on a line: its slope is the
    drift of the clocks. The offset is late by the least delay of the network, some 0.1 ms on a
    cable, and by nothing else: the time between exposure and transmission is known from the
    server's stamps.
    """

    def __init__(self) -> None:
        self.jumps = 0  # how often a clock was set
        self.restart()

    def restart(self) -> None:
        """Forget everything: another server, or another session of it."""
        self._blocks: deque[tuple[float, float]] = deque(maxlen=BLOCKS)  # time, lowest offset
        self._lowest: tuple[float, float] | None = None  # of the present block
        self._begun = 0.0  # server's time [s] at which the present block began
        self._level = self.drift = 0.0  # line through (_at, _level)
        self._at = 0.0
        self.value: float | None = None  # [s] host − server at the newest message

    def add(self, sent: float, arrival: float) -> None:
        """Take a message: sent [s] by the server's clock, arrival [s] by the host's."""
        offset = arrival - sent
        if self._lowest is None:
            self._begin(sent, offset)
        elif self._jumped(sent, offset):
            self.jumps += 1
            self.restart()
            self._begin(sent, offset)
        if sent - self._begun >= BLOCK:
            self._blocks.append(self._lowest)
            self._begun, self._lowest = sent, (sent, offset)
            self._fit()
        elif offset < self._lowest[1]:
            self._lowest = sent, offset
        self._level = min(self._level, offset - self.drift * (sent - self._at))
        self.value = self._line(sent)

    def host(self, time: float) -> float:
        """Return a server's time [s] in the host's clock [s]; after the first message."""
        return time + self._line(time)

    def _begin(self, sent: float, offset: float) -> None:
        self._begun, self._lowest = sent, (sent, offset)
        self._at, self._level = sent, offset

    def _line(self, time: float) -> float:
        return self._level + self.drift * (time - self._at)

    def _jumped(self, sent: float, offset: float) -> bool:
        """Whether a clock was set: one message far too early, or a whole block far too late."""
        if sent < self._begun - JUMP or self._blocks and offset < self._line(sent) - JUMP:
            return True
        late = self._lowest[1] - self._line(self._lowest[0])
        return sent - self._begun >= BLOCK and late > JUMP

    def _fit(self) -> None:
        """Put the line below all blocks; with fewer than FEWEST of them it is level."""
        times, lowest = np.array(self._blocks).T
        self._at = times[-1]
        if len(times) >= FEWEST:
            slope = np.polyfit(times - self._at, lowest - lowest[-1], 1)[0]
            self.drift = float(np.clip(slope, -DRIFT_MAX, DRIFT_MAX))
        self._level = float(np.min(lowest - self.drift * (times - self._at)))


class FrameCount:
    """`received`: in order; `lost`: numbers that never came; `repeated` and `late`: discarded."""

    def __init__(self) -> None:
        self.received = self.lost = self.repeated = self.late = 0
        self._last: int | None = None
        self._missing: set[int] = set()  # among the last RESTART numbers

    def restart(self) -> None:
        """Begin a session: the next number is the first."""
        self._last = None
        self._missing.clear()

    def take(self, number: int) -> bool:
        """Take the number of a frame; False: the frame is repeated or late and must not be used."""
        last = self._last
        if last is not None and last - RESTART < number <= last:
            if number in self._missing:  # overtaken by a later frame: not lost after all
                self._missing.discard(number)
                self.lost -= 1
                self.late += 1
            else:
                self.repeated += 1
            return False
        if last is not None and number > last:
            gap = number - last - 1
            self.lost += gap
            first = max(last + 1, number - RESTART)
            self._missing = {n for n in self._missing if n > number - RESTART}
            self._missing.update(range(first, number))
        else:
            self._missing.clear()
        self._last = number
        self.received += 1
        return True


class Level(Enum):
    """How much of the poses arrives."""

    OK = 0
    WARN = 1
    ERROR = 2


class StampedPose(NamedTuple):
    """Pose at an exposure."""

    payload: bool  # whether it is the payload's, else the vehicle's
    stamp: int  # [ns] of the exposure, host's clock
    position: np.ndarray  # (3,) [m, ENU]
    quaternion: np.ndarray  # (4,) FLU → ENU


class MocapDriver:
    """Converts, stamps and counts.

    Nothing is delivered for a body that is not tracked or not known: its topic falls silent, which
    the supervisor sees as lost motion capture.
    """

    def __init__(
        self, parameters: MocapParameters, calibration: Calibration, source: MocapSource
    ) -> None:
        self._parameters, self._source = parameters, source
        self._calibrations = {parameters.body: calibration}
        if parameters.payload:
            self._calibrations[parameters.payload] = calibration.without_body()
        self._nominal = not calibration.measured
        self.clock, self.count = ClockOffset(), FrameCount()
        self._sessions = 0
        self._untracked = dict.fromkeys(self._calibrations, 0)
        self._last_pose = dict.fromkeys(self._calibrations, -math.inf)  # time.monotonic() [s]
        self._last_frame = -math.inf
        self._stamp = 0  # [ns] of the newest frame
        self._latencies: deque[float] = deque(maxlen=WINDOW)  # [s]

    def check_names(self) -> None:
        """Wait for the list of bodies; raise MocapError if a body is not in it.

        A server that does not answer is no error: it may be started later.
        """
        deadline = time.monotonic() + START_TIME
        while self._source.names is None and time.monotonic() < deadline:
            self._source.frames(0.05)
        if self._parameters.source == "natnet" and (
            missing := unknown_body(self._source, self._calibrations)
        ):
            raise MocapError(missing)

    def close(self) -> None:
        self._source.close()

    def receive(self, timeout: float) -> list[StampedPose]:
        """Return the poses that have arrived; wait at most `timeout` [s] for a packet."""
        return [pose for frame in self._source.frames(timeout) for pose in self.take(frame)]

    def take(self, frame: Frame) -> list[StampedPose]:
        """Return the poses of a frame; none of a frame that is repeated or late."""
        if self._source.sessions != self._sessions:
            self._sessions = self._source.sessions
            self.count.restart()
            self.clock.restart()
        if frame.number is not None and not self.count.take(frame.number):
            return []
        if frame.number is None:
            self.count.received += 1
        stamp = self._stamped(frame)
        self._last_frame = now = time.monotonic()
        found = []
        for name, calibration in self._calibrations.items():
            pose = frame.bodies.get(name)
            if pose is None:
                self._untracked[name] += name in frame.bodies
                continue
            self._last_pose[name] = now
            payload = name != self._parameters.body
            found.append(StampedPose(payload, stamp, *calibration.convert(pose)))
        return found

    def _stamped(self, frame: Frame) -> int:
        """Return the stamp [ns] of the exposure; stamps never go back, except after a set clock."""
        arrival = frame.arrival / SECOND
        if frame.exposed is None:
            exposed = arrival - self._parameters.assumed_latency
        else:
            sent = frame.sent if frame.sent is not None else frame.exposed
            jumps = self.clock.jumps
            self.clock.add(sent, arrival)
            exposed = self.clock.host(frame.exposed)
            if jumps != self.clock.jumps:
                self._latencies.clear()
        stamp = round(exposed * SECOND)
        if self._stamp - LATEST < stamp <= self._stamp:
            stamp = self._stamp + 1000
        self._stamp = stamp
        self._latencies.append(arrival - exposed)
        return stamp

    def health(self) -> tuple[Level, str]:
        """Return the level and one line."""
        now, limit = time.monotonic(), self._parameters.silent_after
        source = self._source
        why = source.failure
        if not source.connected:
            more = f" ({why})" if why else "; is it on, and does it stream?"
            return Level.ERROR, f"no answer of {source.description}{more}"
        if source.names is None and why:
            return Level.ERROR, (
                f"the list of bodies of {source.description} cannot be read: {why}; "
                "stream rigid bodies only"
            )
        if missing := unknown_body(source, self._calibrations):
            return Level.ERROR, missing
        if now - self._last_frame > limit:
            return Level.ERROR, f"no frames from {source.description}; is it paused?"
        body = self._parameters.body
        if now - self._last_pose[body] > limit:
            return (
                Level.ERROR,
                f"body '{body}' is not tracked: markers hidden or out of sight",
            )
        if self._nominal:
            return Level.WARN, (
                f"calibration {self._parameters.calibration} is nominal, not measured: "
                "uam calibrate-mocap"
            )
        payload = self._parameters.payload
        if payload and now - self._last_pose[payload] > limit:
            return Level.WARN, f"body '{payload}' is not tracked"
        return Level.OK, f"poses of '{body}' from {source.description}"

    def values(self) -> dict[str, object]:
        """Return the values for /diagnostics."""
        ordered = sorted(self._latencies)
        offset = self.clock.value
        return {
            "connected to": self._source.description,
            "frames": self.count.received,
            "frames lost": self.count.lost,
            "frames repeated": self.count.repeated,
            "frames late": self.count.late,
            "packets unreadable": self._source.bad,
            "connections": self._source.sessions,
            **{f"not tracked: {name}": n for name, n in self._untracked.items()},
            "latency median [ms]": _milliseconds(ordered, 0.5),
            "latency p99 [ms]": _milliseconds(ordered, 0.99),
            "clock offset [s]": None if offset is None else f"{offset:.6f}",
            "clock drift [ppm]": f"{1e6 * self.clock.drift:.1f}",
            "clock jumps": self.clock.jumps,
        }


def _milliseconds(ordered: list[float], part: float) -> str | None:
    if not ordered:
        return None
    return f"{1e3 * ordered[min(int(part * len(ordered)), len(ordered) - 1)]:.2f}"
