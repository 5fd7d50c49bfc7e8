"""Arming, modes and failsafe: PX4's rules (v1.16) for flying OFFBOARD without radio control.

| event | rule |
|---|---|
| OFFBOARD requested | needs a stream of setpoints faster than 2 Hz for half a second |
| arming | needs a valid estimate from vision, and in OFFBOARD the stream |
| disarming | only when landed, unless forced |
| in OFFBOARD no setpoint for COM_OF_LOSS_T | armed: failsafe Descend until OFFBOARD is requested \
again; disarmed: arming is refused |
| landed for COM_DISARM_LAND after a flight | disarm |
| no take-off for COM_DISARM_PRFLT after arming | disarm |
"""

from __future__ import annotations

import math

from uam_sim_bridge.autopilot.params import Parameters
from uam_sim_bridge.mavlink.protocol.modes import MavResult, Mode, Severity

STREAM_GAP = 0.5  # s, longest interval between two setpoints of a stream (2 Hz)
STREAM_TIME = 0.5  # s, shortest duration of a stream before OFFBOARD


class Commander:
    """The state machine. `texts`: (severity, text) of each STATUSTEXT not yet taken."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.armed = False
        self.mode = Mode.HOLD
        self.failsafe = False
        self.texts: list[tuple[Severity, str]] = []
        self._stream_start = -math.inf
        self._stream_last = -math.inf
        self._armed_at = 0.0
        self._flew = False
        self._landed_at: float | None = None

    def setpoint(self, time: float) -> None:
        """Register a valid setpoint that arrived at `time` [s]."""
        if time - self._stream_last > STREAM_GAP:
            self._stream_start = time
        self._stream_last = time

    def streaming(self, time: float) -> bool:
        """Whether the stream of setpoints allows OFFBOARD."""
        fresh = time - self._stream_last <= STREAM_GAP
        return fresh and self._stream_last - self._stream_start >= STREAM_TIME

    def request_mode(self, time: float, mode: Mode) -> MavResult:
        """Handle a request for a mode."""
        if mode is Mode.OFFBOARD:
            if not self.streaming(time):
                self._say(
                    Severity.CRITICAL,
                    "Switching to mode 'Offboard' is currently not possible: no offboard signal",
                )
                return MavResult.TEMPORARILY_REJECTED
        elif mode not in (Mode.LAND, Mode.HOLD) or (mode is Mode.HOLD and self.armed):
            self._say(Severity.CRITICAL, f"Mode {mode.name.title()} is not available")
            return MavResult.DENIED
        self.mode = mode
        self.failsafe = False
        return MavResult.ACCEPTED

    def request_arm(self, time: float, faults: list[str]) -> MavResult:
        """Handle a request to arm; it is refused if the estimator reports `faults`."""
        if self.armed:
            return MavResult.ACCEPTED
        reasons = list(faults)
        if self.mode is not Mode.OFFBOARD:
            reasons.append(
                f"Preflight Fail: mode {self.mode.name.title()} needs radio control or "
                "position; switch to Offboard"
            )
        elif not self.streaming(time):
            reasons.append("Preflight Fail: no offboard signal")
        if reasons:
            for reason in reasons:
                self._say(Severity.CRITICAL, reason)
            self._say(Severity.CRITICAL, "Arming denied: Resolve system health failures first")
            return MavResult.TEMPORARILY_REJECTED
        self.armed, self._armed_at = True, time
        self._flew, self._landed_at = False, None
        self._say(Severity.INFO, "Armed by external command")
        return MavResult.ACCEPTED

    def request_disarm(self, landed: bool, force: bool) -> MavResult:
        """Handle a request to disarm."""
        if self.armed and not landed and not force:
            self._say(Severity.CRITICAL, "Disarming denied: not landed")
            return MavResult.TEMPORARILY_REJECTED
        if self.armed:
            self._disarm("Disarmed by external command" + (" (forced)" if force else ""))
        return MavResult.ACCEPTED

    def update(self, time: float, landed: bool) -> None:
        """Apply the rules for timeouts: failsafe and automatic disarming; call once per tick."""
        if not self.armed:
            return
        parameters = self._parameters
        if self.mode is Mode.OFFBOARD and time - self._stream_last > parameters["COM_OF_LOSS_T"]:
            self.mode = Mode.LAND
            self.failsafe = True
            self._say(Severity.CRITICAL, "Failsafe activated: no offboard signal, descending")
        if not landed:
            self._flew, self._landed_at = True, None
            return
        if self._landed_at is None:
            self._landed_at = time
        wait = parameters["COM_DISARM_LAND" if self._flew else "COM_DISARM_PRFLT"]
        since = self._landed_at if self._flew else self._armed_at
        if wait > 0.0 and time - since > wait:
            self._disarm("Disarmed by landing" if self._flew else "Disarmed by auto preflight")

    def take_texts(self) -> list[tuple[Severity, str]]:
        """Return the texts since the last call."""
        texts, self.texts = self.texts, []
        return texts

    def _disarm(self, text: str) -> None:
        self.armed = False
        if self.failsafe:
            self.mode, self.failsafe = Mode.HOLD, False
        self._say(Severity.INFO, text)

    def _say(self, severity: Severity, text: str) -> None:
        self.texts.append((severity, text))
