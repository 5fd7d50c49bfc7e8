"""The telemetry streams of the bridge: requests each rate, then counts the messages.

COMMAND_ACK does not name the message of the SET_MESSAGE_INTERVAL that it answers, so each request
waits for the answer to the previous one. PX4 refuses to change the rate of HEARTBEAT; HEARTBEAT is
therefore only counted.
"""

import math
from collections.abc import Mapping

from uam_control.offboard.modes import MavResult, result_word
from uam_sim_bridge.mavlink.protocol.wire import mavlink2

# message id → desired rate [Hz]
RATES: dict[int, float] = {
    mavlink2.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    mavlink2.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 5.0,
    mavlink2.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 10.0,
    mavlink2.MAVLINK_MSG_ID_ODOMETRY: 10.0,
    mavlink2.MAVLINK_MSG_ID_SYS_STATUS: 2.0,
    mavlink2.MAVLINK_MSG_ID_BATTERY_STATUS: 1.0,
    mavlink2.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 2.0,
}
ONLY_COUNTED = (mavlink2.MAVLINK_MSG_ID_HEARTBEAT,)
# sent on a change: PX4 sends CURRENT_MODE at once when the mode changes, HEARTBEAT once a second
ON_CHANGE: dict[int, float] = {mavlink2.MAVLINK_MSG_ID_CURRENT_MODE: 50.0}
SILENT = 0.7  # s without one of these, which PX4 sends twice a second, too: requested again
ENOUGH = 0.5  # fraction of the desired rate, below which a stream is too slow
WINDOW = 4.0  # s, counting window
ANSWER_TIMEOUT = 0.5  # s, then the next request is sent without an answer
ATTEMPTS = 3  # requests for one stream
PERIOD = 1.0  # s, window of the rate


class StreamCheck:
    """Requests the streams and checks their rates."""

    def __init__(self, further: Mapping[int, float] | None = None) -> None:
        """further: streams besides RATES, message id → desired rate [Hz]."""
        self._desired = RATES | dict(further or {})
        self.restart()

    def restart(self) -> None:
        """Request all streams again, for a new or rebooted autopilot."""
        self.warnings: tuple[str, ...] = ()  # one line per stream that is too slow or was refused
        self.rates: dict[int, float] = {}  # message id → rate [Hz] over the last window
        self._queue = [n for n in self._desired if n not in ONLY_COUNTED] + [*ON_CHANGE]
        self._attempts = dict.fromkeys((*self._desired, *ON_CHANGE), 0)
        self._refused: dict[int, str] = {}
        self._counts = dict.fromkeys(self._desired, 0)
        self._heard = dict.fromkeys(ON_CHANGE, math.inf)  # [s] newest message
        self._pending: int | None = None
        self._requested_at = -math.inf
        self._window: float | None = None  # s, start of the window; None during requests

    def count(self, number: int, time: float) -> None:
        """Count a message of this id received at `time` [s]."""
        if number in self._counts:
            self._counts[number] += 1
        elif number in self._heard:
            self._heard[number] = time

    def answer(self, result: int) -> None:
        """Store the result (MAV_RESULT) of the last request."""
        number, self._pending = self._pending, None
        if number is None:
            return
        if result == MavResult.ACCEPTED:
            self._refused.pop(number, None)
        else:
            self._refused[number] = result_word(result)

    def request(self, time: float) -> tuple[int, float] | None:
        """Return message id and interval [us] of the request due at `time` [s]; None if none is."""
        if self._pending is not None and time - self._requested_at < ANSWER_TIMEOUT:
            return None
        self._pending = None
        silent = [n for n, heard in self._heard.items() if time - heard > SILENT]
        if not (self._queue or silent):
            self._judge(time)
            return None
        number = silent[0] if silent else self._queue.pop(0)
        if silent:
            self._heard[number] = time
        self._attempts[number] += 1
        self._pending, self._requested_at = number, time
        return number, 1e6 / (self._desired | ON_CHANGE)[number]

    def _judge(self, time: float) -> None:
        if self._window is None:
            self._begin(time)
        if time - self._window < WINDOW:
            return
        self.rates = {
            number: count / (time - self._window) for number, count in self._counts.items()
        }
        slow = [
            number
            for number, rate in self._desired.items()
            if self.rates[number] < ENOUGH * rate or number in self._refused
        ]
        self.warnings = tuple(self._words(number) for number in slow)
        self._queue = [
            number
            for number in slow
            if number not in ONLY_COUNTED and self._attempts[number] < ATTEMPTS
        ]
        self._begin(time)
        if self._queue:
            self._window = None

    def _begin(self, time: float) -> None:
        self._window = time
        self._counts = dict.fromkeys(self._desired, 0)

    def _words(self, number: int) -> str:
        name = mavlink2.mavlink_map[number].msgname
        rate, desired = self.rates[number], self._desired[number]
        received = f"received at {rate:.1f} Hz" if rate > 0.0 else "not received"
        refused = self._refused.get(number)
        request = (
            f"requested at {desired:g} Hz"
            if refused is None
            else f"request for {desired:g} Hz refused ({refused})"
        )
        return f"{name} {received}, {request}"


class LinkStatistics:
    """Counts received messages. `rate` [1/s]: over the last second; `received`: in total."""

    def __init__(self) -> None:
        self.rate = 0.0
        self.received = 0
        self._gaps = 0
        self._sequences: dict[int, int] = {}  # component → its last sequence number
        self._at, self._before = -math.inf, 0

    def count(self, component: int, sequence: int) -> None:
        """Count a message of one component of the autopilot's system."""
        self.received += 1
        last = self._sequences.get(component)
        self._sequences[component] = sequence
        if last is not None:
            gap = (sequence - last - 1) % 256
            if gap < 128:  # larger: messages arrived out of order
                self._gaps += gap

    def lost(self, unread: int) -> int:
        """Return the number of lost messages; unread: messages received but not counted here."""
        return max(0, self._gaps - unread)

    def restart(self) -> None:
        """Accept any next sequence number: after a reboot a jump is no loss."""
        self._sequences.clear()

    def tick(self, time: float) -> None:
        """Update `rate` at the tick `time` [s]."""
        since = time - self._at
        if since < PERIOD:
            return
        if math.isfinite(since):
            self.rate = (self.received - self._before) / since
        self._at, self._before = time, self.received
