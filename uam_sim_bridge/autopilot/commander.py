"""Arming, modes and failsafe: PX4's rules (v1.16); the simulated battery, PX4's SIM_BAT_*.

| event | rule |
|---|---|
| OFFBOARD requested | needs a stream of setpoints faster than 2 Hz for half a second |
| arming | needs a valid estimate from vision, and in OFFBOARD the stream |
| disarming | only when landed, unless forced |
| in OFFBOARD no setpoint for COM_OF_LOSS_T | armed: failsafe Descend until OFFBOARD is requested \
again; disarmed: arming is refused |
| HOLD, RETURN requested in flight | need a valid estimate (PX4 also needs a global origin) |
| POSITION requested | needs a valid estimate, and sticks (MANUAL_CONTROL) |
| sticks moved by COM_RC_STICK_OV | POSITION, if COM_RC_OVERRIDE has the bit of the mode |
| in POSITION no sticks for COM_RC_LOSS_T | armed: failsafe, land |
| battery below BAT_LOW_THR | armed: warning |
| battery below BAT_CRIT_THR | armed: failsafe by COM_LOW_BAT_ACT; below BAT_EMERGEN_THR land |
| kill switch engaged | motors stop; armed and mode stay, the motors turn again when it is \
released within COM_KILL_DISARM; then disarm; arming is refused |
| flight termination, in flight | motors stop, mode TERMINATION, until a restart |
| a mode requested in a failsafe | accepted: a person takes over |
| landed for COM_DISARM_LAND after a flight | disarm |
| no take-off for COM_DISARM_PRFLT after arming | disarm |
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np

from uam_control.maths.compiled import borrowing, prepared
from uam_control.maths.memory import Number, record
from uam_control.offboard.modes import MavResult, Mode, Severity
from uam_control.settings.plain_members import plain_members
from uam_sim_bridge.autopilot.params import Parameters

STREAM_GAP = 0.5  # s, longest interval between two setpoints of a stream (2 Hz)
STREAM_TIME = 0.5  # s, shortest duration of a stream before OFFBOARD


@plain_members
class ChargeState(IntEnum):
    """MAV_BATTERY_CHARGE_STATE: the values in use. `LOW` and worse are PX4's warnings."""

    UNDEFINED = 0
    OK = 1
    LOW = 2
    CRITICAL = 3
    EMERGENCY = 4


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

    @property
    def state(self) -> ChargeState:
        """Return the state that the charge has by BAT_LOW_THR, BAT_CRIT_THR, BAT_EMERGEN_THR."""
        p, charge = self._parameters, self.charge
        if charge is None:
            return ChargeState.UNDEFINED
        if charge < p["BAT_EMERGEN_THR"]:
            return ChargeState.EMERGENCY
        if charge < p["BAT_CRIT_THR"]:
            return ChargeState.CRITICAL
        return ChargeState.LOW if charge < p["BAT_LOW_THR"] else ChargeState.OK


BATTERY_WARNINGS = {
    ChargeState.LOW: "Low battery",
    ChargeState.CRITICAL: "Critical battery",
    ChargeState.EMERGENCY: "Emergency battery level",
}


@borrowing
def take_setpoint(commander: np.ndarray, time: float) -> None:
    """Register a valid setpoint that arrived at `time` [s]; commander (1,): its memory."""
    m = commander[0]
    if time - m.stream_last > STREAM_GAP:
        m.stream_start = time
    m.stream_last = time


class Commander:
    """The state machine.

    `mode`: flown; `intended`: chosen last by a person or a companion (it stays in a failsafe);
    `texts`: (severity, text) of each STATUSTEXT not yet taken.
    """

    _stream_start, _stream_last, _updated = Number(), Number(), Number()

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.armed = False
        self.mode = self.intended = Mode.HOLD
        self.failsafe = False
        # [s]: first and last setpoint of the stream, last update
        self.memory = record("", "stream_start stream_last updated")
        self.memory[0] = (-math.inf,) * 3
        self._take_setpoint = prepared(take_setpoint, self.memory, 0.0)
        self._killed_at = -math.inf  # [s] since when the switch is engaged
        self._killed = False
        self.texts: list[tuple[Severity, str]] = []
        self._sticks_last = -math.inf
        self._sticks_at_rest: tuple[float, ...] | None = None
        self._battery = ChargeState.UNDEFINED  # the worst since arming
        self._low_battery: Mode | None = None  # failsafe of the battery that has begun
        self._armed_at = 0.0
        self._flew = False
        self._landed_at: float | None = None

    @property
    def flies_offboard(self) -> bool:
        """Whether it flies the companion's setpoints and has left the ground."""
        flies = self.armed and self.mode is Mode.OFFBOARD and not self._killed
        return flies and self._flew and self._landed_at is None

    @property
    def stopped(self) -> bool:
        """Whether kill switch or flight termination hold the motors."""
        return self._killed or self.mode is Mode.TERMINATION

    def kill(self, engaged: bool, landed: bool) -> None:
        """Handle the kill switch; no effect without a change."""
        if engaged is self._killed:
            return
        self._killed, self._killed_at = engaged, self._updated
        severity = Severity.CRITICAL if engaged and not landed else Severity.INFO
        self._say(severity, "Kill engaged" if engaged else "Kill disengaged")

    def terminate(self) -> MavResult:
        if not self.armed:
            return MavResult.DENIED
        self.mode = self.intended = Mode.TERMINATION
        return MavResult.ACCEPTED

    def setpoint(self, time: float) -> None:
        """See `take_setpoint`."""
        self._take_setpoint(self.memory, time)

    def streaming(self, time: float) -> bool:
        """Whether the stream of setpoints allows OFFBOARD."""
        fresh = time - self._stream_last <= STREAM_GAP
        return fresh and self._stream_last - self._stream_start >= STREAM_TIME

    def sticks(self, time: float, values: tuple[float, ...], aided: bool) -> None:
        """Handle stick positions -1..1 at `time` [s]; aided: whether the estimate is valid."""
        self._sticks_last = time
        if self._sticks_at_rest is None or self.mode is Mode.POSITION:
            self._sticks_at_rest = values
            return
        p = self._parameters
        moved = max(abs(a - b) for a, b in zip(values, self._sticks_at_rest, strict=True))
        bit = 2 if self.mode is Mode.OFFBOARD else 1
        overriding = int(p["COM_RC_OVERRIDE"]) & bit and 100.0 * moved > p["COM_RC_STICK_OV"]
        if self.armed and overriding and aided and self.mode is not Mode.TERMINATION:
            self.intended = self.mode = Mode.POSITION
            self.failsafe = False
            self._say(Severity.CRITICAL, "Pilot took over using sticks")

    def request_mode(self, time: float, mode: Mode, aided: bool) -> MavResult:
        """Handle a request for a mode; aided: whether the estimate is valid."""
        if self.mode is Mode.TERMINATION:
            return MavResult.TEMPORARILY_REJECTED
        if mode is Mode.OFFBOARD:
            if not self.streaming(time):
                self._say(
                    Severity.CRITICAL,
                    "Switching to mode 'Offboard' is currently not possible: no offboard signal",
                )
                return MavResult.TEMPORARILY_REJECTED
        elif not self._available(time, mode, aided):
            self._say(Severity.CRITICAL, f"Mode {mode.name.title()} is not available")
            return MavResult.DENIED
        self.mode = self.intended = mode
        self.failsafe = False
        return MavResult.ACCEPTED

    def _available(self, time: float, mode: Mode, aided: bool) -> bool:
        if mode is Mode.POSITION:
            return aided and self._has_sticks(time)
        if mode in (Mode.HOLD, Mode.RETURN):
            return aided or not self.armed
        return mode is Mode.LAND

    def _has_sticks(self, time: float) -> bool:
        return time - self._sticks_last <= self._parameters["COM_RC_LOSS_T"]

    def request_arm(self, time: float, faults: list[str]) -> MavResult:
        """Handle a request to arm; it is refused if the estimator reports `faults`."""
        if self.armed:
            return MavResult.ACCEPTED
        reasons = list(faults)
        if self._killed:
            reasons.append("Preflight Fail: Kill switch engaged")
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
        if self.armed and not landed and not force:
            self._say(Severity.CRITICAL, "Disarming denied: not landed")
            return MavResult.TEMPORARILY_REJECTED
        if self.armed:
            self._disarm("Disarmed by external command" + (" (forced)" if force else ""))
        return MavResult.ACCEPTED

    def update(self, time: float, landed: bool, battery: ChargeState) -> None:
        """Apply the rules for timeouts, battery and automatic disarming; call once per tick."""
        self._updated = time
        if not self.armed:
            return
        parameters = self._parameters
        if self._killed and time - self._killed_at > parameters["COM_KILL_DISARM"]:
            self._disarm("Disarmed by kill-switch")
            return
        if self.mode is Mode.OFFBOARD and time - self._stream_last > parameters["COM_OF_LOSS_T"]:
            self._fail(Mode.LAND, "no offboard signal, descending")
        if self.mode is Mode.POSITION and not self._has_sticks(time):
            self._fail(Mode.LAND, "no manual control signal, landing")
        if battery > self._battery:
            self._watch_battery(battery)
        if not landed:
            self._flew, self._landed_at = True, None
            return
        if self._landed_at is None:
            self._landed_at = time
        wait = parameters["COM_DISARM_LAND" if self._flew else "COM_DISARM_PRFLT"]
        since = self._landed_at if self._flew else self._armed_at
        if wait > 0.0 and time - since > wait:
            self._disarm("Disarmed by landing" if self._flew else "Disarmed by auto preflight")

    def _watch_battery(self, state: ChargeState) -> None:
        """Warn and act once for a worse charge state; while armed a better one has no effect."""
        self._battery = state
        if state in BATTERY_WARNINGS:
            self._say(Severity.EMERGENCY, BATTERY_WARNINGS[state])
        low, action = int(self._parameters["COM_LOW_BAT_ACT"]), None
        if low and state is ChargeState.EMERGENCY:
            action = Mode.LAND
        elif low and state is ChargeState.CRITICAL:
            action = Mode.RETURN if low == 3 else Mode.LAND
        if action is not None and action is not self._low_battery:
            self._low_battery = action
            words = "landing" if action is Mode.LAND else "returning"
            self._fail(action, f"critical battery level, {words}")

    def _fail(self, mode: Mode, text: str) -> None:
        """Begin a failsafe; `intended` stays. Nothing follows flight termination."""
        if self.mode is Mode.TERMINATION:
            return
        self.mode, self.failsafe = mode, True
        self._say(Severity.CRITICAL, f"Failsafe activated: {text}")

    def take_texts(self) -> list[tuple[Severity, str]]:
        """Return the texts since the last call."""
        texts, self.texts = self.texts, []
        return texts

    def _disarm(self, text: str) -> None:
        self.armed, self._low_battery = False, None
        self._battery = ChargeState.UNDEFINED
        if self.failsafe and self.mode is not Mode.TERMINATION:
            self.mode, self.failsafe = Mode.HOLD, False
            self.intended = Mode.HOLD
        self._say(Severity.INFO, text)

    def _say(self, severity: Severity, text: str) -> None:
        self.texts.append((severity, text))
