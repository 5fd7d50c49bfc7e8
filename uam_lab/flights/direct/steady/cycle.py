"""Autopilot: one cycle of its estimator, commander, rate loop and land detector."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uam_control.ages import UNAIDED
from uam_control.frames import swap_sample
from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import record
from uam_control.offboard.modes import Mode
from uam_lab.flights.direct.steady.bridge import BridgeArrays
from uam_sim_bridge.autopilot.autopilot_estimator import (
    HISTORY,
    predict,
)
from uam_sim_bridge.autopilot.core import LONGEST_STEP, SHORTEST_STEP, RateLoop, control_tick
from uam_sim_bridge.autopilot.joined import HEARTBEAT, LANDED, JoinedAutopilot, following


class CycleArrays(NamedTuple):
    """State of the autopilot. gyro, force (3,): newest sample, FRD; memory: WHOLE, REAL."""

    loop: RateLoop
    gyro: np.ndarray
    force: np.ndarray
    memory: np.ndarray


WHOLE = "newest"
REAL = "time stream_timeout low_thrust heartbeat_due landed_due"


class CyclePart:
    """The part of the autopilot in a `JoinedAutopilot`."""

    def __init__(self, port: JoinedAutopilot) -> None:
        self._port = port
        self.memory = record(WHOLE, REAL)

    def load(self) -> bool:
        """Copy the state into the arrays; return whether its ticks may be steady."""
        port, autopilot = self._port, self._port.autopilot
        commander, landing = autopilot.commander, autopilot.landing
        p = autopilot.parameters
        ready = (
            commander.armed
            and commander.mode is Mode.OFFBOARD
            and autopilot._position is None
            and autopilot._desired is None
            and autopilot._time is not None
            and not p["SIM_BAT_ENABLE"]
            and not (landing.contact or landing.maybe_landed or landing.landed)
            and commander._flew
            and commander._landed_at is None
        )
        if not ready:
            return False
        self.memory[0] = (
            *(autopilot.estimator._newest, autopilot._time, p["COM_OF_LOSS_T"], landing._low),
            *(port._heartbeat_due, port._landed_due),
        )
        return True

    def arrays(self) -> CycleArrays:
        """Return the arrays."""
        return CycleArrays(self._port.autopilot._loop, *self._port._own_sample, self.memory)

    def store(self) -> None:
        """Copy the state back after a cycle."""
        port, autopilot = self._port, self._port.autopilot
        newest, time, _, _, heartbeat, landed = self.memory[0].item()
        autopilot.estimator._newest, autopilot._time = newest, time
        autopilot.landing._since[:] = math.inf, math.inf, math.inf
        autopilot.imu = port._own_sample
        port._heartbeat_due, port._landed_due = heartbeat, landed


@borrowing
def cycle(
    a: CycleArrays, b: BridgeArrays, time: float, gyro: np.ndarray, force: np.ndarray
) -> bool:
    """Do what `JoinedAutopilot.update` does at `time` [s]; False, and nothing, where it decides.

    gyro (3,) [rad/s], force (3,) [m/s^2]: sample, FLU.
    """
    m, link = a.memory[0], b.memory[0]
    if time - link.stream_last > m.stream_timeout or not b.setpoint[3] > m.low_thrust:
        return False
    swap_sample(gyro, force, a.gyro, a.force)
    dt = min(LONGEST_STEP, max(SHORTEST_STEP, time - m.time))
    m.time = time
    m.newest = (m.newest + 1) % HISTORY
    aided = time - link.vision_time < UNAIDED
    predict(a.gyro, a.force, time, dt, aided, m.newest, b.vision)
    control_tick(a.gyro, dt, True, False, b.setpoint, a.loop)
    if time >= m.heartbeat_due - 1e-9:
        link.heartbeat = 1
        m.heartbeat_due = following(m.heartbeat_due, HEARTBEAT, time)
    if time >= m.landed_due - 1e-9:
        link.landed = 1
        m.landed_due = following(m.landed_due, LANDED, time)
    return True
