"""State of the vehicle from the status messages of its nodes, for the page's headline."""

import math
import time
from dataclasses import dataclass, field

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray

from uam_control.coordinates import ARM, ATTITUDE, POSITION
from uam_control.supervision import PreflightCheck, State
from uam_control.supervision.supervision_parameters import SupervisionLimits
from uam_msgs_py.messages.status import (
    ERROR,
    OK,
    STALE,
    WARN,
    AutopilotState,
    MissionStatus,
    finite,
)
from uam_msgs_py.node.namespace import unlabelled

GOOD, CAUTION, BAD, UNKNOWN = "good", "caution", "bad", "unknown"
LEVELS = {OK: GOOD, WARN: CAUTION, ERROR: BAD, STALE: CAUTION}
ORDER = (UNKNOWN, GOOD, CAUTION, BAD)
TICK = "tick max [ms]"  # in the diagnostics of each node
CHAIN = ("state_estimator", "position_controller", "attitude_controller", "mavlink_bridge")


@dataclass
class NodeHealth:
    """Last diagnostics of one node; heard: time.monotonic() of the message [s]."""

    level: str
    summary: str
    heard: float


# of the delay margin, until the mission's parameters are known
SHARES = (SupervisionLimits.delay_warn, SupervisionLimits.delay_land)


@dataclass
class Health:
    """Last received states; a node counts as lost after `silent_after` [s] wall time."""

    silent_after: float
    namespace: str = "/"  # of the vehicle's nodes
    mission: MissionStatus | None = None
    autopilot: AutopilotState | None = None
    battery: float = math.nan  # 0..1
    real_time_factor: str = ""
    nodes: dict[str, NodeHealth] = field(default_factory=dict)
    saturated: set[str] = field(default_factory=set)
    frozen: set[str] = field(default_factory=set)
    silence: float | None = None  # [s] wall time since the last message of the control loop
    errors: tuple[float, float, float] = (math.nan,) * 3  # norms: [m], [rad], [rad]
    preflight: list[PreflightCheck] = field(default_factory=list)
    ticks: dict[str, float] = field(default_factory=dict)  # node → longest of the last second [s]
    # shares of the delay margin at which the mission warns and lands
    delay_shares: tuple[float, ...] = SHARES
    period: float = math.nan  # [s] of control
    refused: int = 0  # messages that the page cannot use
    sparing: bool = False  # whether the page leaves out charts, as processor time is short
    _tracked: bool = False  # whether the errors come from /uam/tracking/error

    def set_mission(self, mission: MissionStatus) -> None:
        """Store the mission's status, which comes twice per second."""
        self.mission = mission
        if not self._tracked:
            self.errors = mission.position_error, mission.attitude_error, mission.arm_error

    def track(self, error: np.ndarray) -> None:
        """Store the tracking error, estimate - reference: chi (6 + n,), m and rad."""
        self._tracked = True
        self.errors = tuple(float(np.linalg.norm(error[p])) for p in (POSITION, ATTITUDE, ARM))

    def diagnose(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name = unlabelled(self.namespace, status.name)
            if name is None:
                continue
            level = LEVELS.get(status.level, BAD)
            self.nodes[name] = NodeHealth(level, status.message, time.monotonic())
            for pair in status.values:
                if pair.key == "real time factor":
                    self.real_time_factor = pair.value
                elif pair.key == "saturated":
                    change = set.add if pair.value == "True" else set.discard
                    change(self.saturated, name)
                elif pair.key == TICK and (most := finite(pair.value)) is not None:
                    self.ticks[name] = 1e-3 * most

    @property
    def latency(self) -> float:
        """Computing time [s] from sensors to setpoint: the longest ticks of the nodes on that way.

        NaN until all of them have reported.
        """
        return sum(self.ticks.get(node, math.nan) for node in CHAIN)

    def state(self) -> tuple[str, str, str]:
        """Return level, text and reason ("" without one) of the flight's state."""
        mission, silence = self.mission, self.silence
        if mission is None or silence is None:
            return UNKNOWN, "waiting for a flight", ""
        if mission.done:
            return BAD if mission.abort_reason else GOOD, "flight over", mission.abort_reason
        if silence > self.silent_after:
            return BAD, f"no signal for {silence:.0f} s", ""
        if mission.state == State.FAILSAFE.value:
            return BAD, mission.state, mission.cause
        if mission.abort_reason:
            return BAD, mission.phase, mission.abort_reason
        if mission.level == WARN:
            return CAUTION, mission.state, mission.cause
        return GOOD, mission.phase, ""

    def ailing(self) -> list[tuple[str, str, str]]:
        """Return (node, level, problem) of the nodes with problems, worst first."""
        found = []
        for name, node in self.nodes.items():
            gone = time.monotonic() - node.heard
            if gone > self.silent_after:
                found.append((name, BAD, f"silent for {gone:.0f} s"))
            elif node.level != GOOD:
                found.append((name, node.level, node.summary))
        return sorted(found, key=lambda one: -ORDER.index(one[1]))


def grade(value: float, caution: float, bad: float) -> str:
    """Return the level of a value: large values are bad, or small ones if caution > bad."""
    if not math.isfinite(value):
        return UNKNOWN
    worse = value.__ge__ if caution < bad else value.__le__
    return BAD if worse(bad) else CAUTION if worse(caution) else GOOD
