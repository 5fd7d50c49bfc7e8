"""States in a diagnostic_msgs/DiagnosticArray: one status with key-value pairs."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import ClassVar, Self

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.ros_time import nanoseconds, set_stamp

OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN
ERROR, STALE = DiagnosticStatus.ERROR, DiagnosticStatus.STALE


def status_of(name: str, level: bytes, message: str, values: dict[str, object]) -> DiagnosticStatus:
    """Return a status; a None in `values` becomes ""."""
    texts = {key: "" if value is None else str(value) for key, value in values.items()}
    pairs = [KeyValue(key=key, value=text) for key, text in texts.items()]
    return DiagnosticStatus(
        level=level, name=name, hardware_id="uam", message=message, values=pairs
    )


def texts_of(status: DiagnosticStatus) -> dict[str, str]:
    """Return the values of a status: key → text."""
    return {pair.key: pair.value for pair in status.values}


def diagnostics(stamp: int, statuses: Iterable[DiagnosticStatus]) -> DiagnosticArray:
    """Return the message with these; stamp [ns]."""
    array = DiagnosticArray(status=list(statuses))
    set_stamp(array.header.stamp, stamp)
    return array


def diagnostic(
    stamp: int, name: str, level: bytes, message: str, values: dict[str, object]
) -> DiagnosticArray:
    """Return a DiagnosticArray with one status, see `status_of`; stamp [ns]."""
    return diagnostics(stamp, [status_of(name, level, message, values)])


def only_status(message: DiagnosticArray) -> tuple[int, DiagnosticStatus, dict[str, str]]:
    """Return (stamp [ns], status, key → text) of a message with one status, else ValueError."""
    (status,) = message.status
    return nanoseconds(message.header.stamp), status, texts_of(status)


class _Status:
    """Conversion of a dataclass to and from the key-value pairs of one status."""

    LATER: ClassVar[tuple[str, ...]] = ()  # entries that older logs lack

    def to_message(self, stamp: int) -> DiagnosticArray:
        """Return the message; stamp [ns]."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        return diagnostic(stamp, self.NAME, self.level, self.summary, values)

    @classmethod
    def from_message(cls, message: DiagnosticArray) -> tuple[int, Self]:
        """Return (stamp [ns], status); raises BadMessage for a missing or invalid entry."""
        found = [status for status in message.status if status.name == cls.NAME]
        if not found:
            raise BadMessage(f"no status '{cls.NAME}' in the message")
        texts, values = texts_of(found[0]), {}
        for item in fields(cls):
            if item.name not in texts:
                if item.name in cls.LATER:
                    continue
                raise BadMessage(f"{cls.NAME}: '{item.name}' is missing")
            try:
                values[item.name] = _READ[item.type](texts[item.name])
            except ValueError:
                raise BadMessage(
                    f"{cls.NAME}: '{item.name}' is {texts[item.name]!r}, {item.type} expected"
                ) from None
        return nanoseconds(message.header.stamp), cls(**values)


def _truth(text: str) -> bool:
    if text not in ("True", "False"):
        raise ValueError(text)
    return text == "True"


def _whole(text: str) -> int:
    value = int(text)
    if not -(1 << 63) <= value < 1 << 63:
        raise ValueError(text)
    return value


def finite(text: str | None) -> float | None:
    """Return the number of a text, None for anything else; for values of /diagnostics."""
    try:
        value = float(text or "")
    except ValueError:
        return None
    return value if math.isfinite(value) else None


_READ = {
    str: str,
    float: float,
    bool: _truth,
    int: _whole,
    int | None: lambda text: _whole(text) if text else None,
    float | None: lambda text: float(text) if text else None,
}


@dataclass(frozen=True)
class AutopilotState(_Status):
    """State of the autopilot as the bridge receives it; sent on change and five times a second."""

    connected: bool = False
    mode: str = ""
    armed: bool = False
    armed_since: int | None = None  # stamp [ns] of the first tick reported armed, None: disarmed
    reasons: str = ""  # why it is not armed or has left OFFBOARD, joined by "; "
    round_trip: float | None = None  # [s] shortest of the last second; None if unknown
    released_to: str = ""  # who has control in place of the companion, "" if nobody has
    landed: bool = False  # by the autopilot's land detector
    lands: bool = False  # its mode lands the vehicle by itself, or it is silent and may do so
    loop_delay: float | None = None  # [s] body-rate setpoint to the gyro's response; None: unknown
    failed: str = ""  # why the bridge flies no more, "" while it may
    stopped: bool = False  # a kill has ended the flight for good

    NAME = "autopilot"
    LATER = (
        *("round_trip", "released_to", "landed", "lands", "loop_delay"),
        *("failed", "stopped"),
    )

    @property
    def level(self) -> bytes:
        """Return STALE without a connection, ERROR if the bridge has failed, WARN with reasons."""
        if not self.connected:
            return STALE
        if self.failed:
            return ERROR
        return WARN if self.reasons or self.released_to else OK

    @property
    def summary(self) -> str:
        """Return the state in one line."""
        if not self.connected:
            return "not connected"
        held = f"; {self.released_to}, has control" if self.released_to else ""
        return f"{self.mode}, {'armed' if self.armed else 'disarmed'}{held}"


@dataclass(frozen=True)
class MissionStatus(_Status):
    """State of the mission; sent on each change of phase and twice a second. None: unknown."""

    phase: str = "waiting"
    time: float = -1.0  # [s] mission time, negative before take-off
    position_error: float = 0.0  # [m] norm of estimate − reference, two ticks before
    attitude_error: float = 0.0  # [rad] the same, from the desired attitude of the position law
    arm_error: float = 0.0  # [rad] the same
    done: bool = False
    abort_reason: str = ""
    magnet: bool = False  # whether it is on (/uam/magnet has no stamp, this message has one)
    state: str = "grounded"  # the supervisor's (uam_control.supervision.State)
    cause: str = ""  # reason for the state
    regains: int = 0  # number of commands so far to regain a released vehicle
    tilt: float = 0.0  # [rad] angle between the vertical axes of body and world
    answers: int = 0  # number of goals and trajectories answered so far
    answer: str = ""  # the newest, "topic: accepted ..." or "topic: refused ..."
    grasp: str = ""  # state of the grasp (uam_control.grasp.Grasp)
    attempt: int = 0  # number of the approach
    decisions: int = 0  # number of decisions about the payload so far
    grasp_text: str = ""  # the newest of them
    delay: float = 0.0  # [s] of the scenario's clock by holds and grasps
    setpoint_delay: float | None = None  # [s] how much later they act than in the profile's model
    delay_margin: float | None = None  # [s] delay at which the loops oscillate

    NAME = "mission"
    LATER = (
        *("state", "cause", "regains", "tilt", "answers", "answer"),
        *("grasp", "attempt", "decisions", "grasp_text", "delay"),
        *("setpoint_delay", "delay_margin"),
    )

    @property
    def level(self) -> bytes:
        """Return ERROR after an abort, WARN where the scenario stops, else OK."""
        if self.abort_reason:
            return ERROR
        return WARN if self.state in ("holding", "released", "blind") else OK

    @property
    def summary(self) -> str:
        """Return the phase, or the reason of an abort."""
        return self.abort_reason or self.phase


@dataclass(frozen=True)
class ChecklistState(_Status):
    """State of the checklist of a real vehicle; sent on change and five times a second."""

    passed: bool = False  # every item has
    failing: str = ""  # names of the others, joined by "; "
    step: str = ""  # what a person does now, machine-readable, "" for nothing
    needs: str = ""  # "motion", "confirm" or ""
    instruction: str = ""  # for the person
    seen: str = ""  # for the person
    failed: bool = False  # the step is tried again after a failure
    commands: bool = False  # the mission computes body rates for the vehicle in the person's hands

    NAME = "checklist"

    @property
    def level(self) -> bytes:
        """Return OK after all items have passed, ERROR after a failed step, else WARN."""
        if self.passed:
            return OK
        return ERROR if self.failed else WARN

    @property
    def summary(self) -> str:
        """Return the state in one line."""
        return "all items passed" if self.passed else f"open: {self.failing}"


@dataclass(frozen=True)
class RadioState(_Status):
    """What the autopilot reports of the pilot's radio; a further status of /uam/autopilot/state."""

    killed: bool = False  # its kill switch is engaged (HEARTBEAT: MAV_STATE_FLIGHT_TERMINATION)
    received: str = ""  # by the autopilot (SYS_STATUS, RC receiver): "yes", "no", "": unknown

    NAME = "radio"

    @property
    def level(self) -> bytes:
        """Return WARN with an engaged kill switch or without the radio, else OK."""
        return WARN if self.killed or self.received == "no" else OK

    @property
    def summary(self) -> str:
        """Return the state in one line."""
        known = {"yes": "received", "no": "not received"}.get(self.received, "unknown")
        return f"{known}; kill switch engaged" if self.killed else known
