"""What the supervisor is shown at a tick, and what it may be told to do."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from uam_control.supervision.states import Event


class OperatorCommand(Enum):
    """What people may ask for in flight; the value is its event."""

    HOLD = Event.HOLD
    RESUME = Event.RESUME
    LAND = Event.LAND
    DISARM = Event.DISARM


@dataclass
class Readings:
    """What is known besides state and reference; NaN where it is not, and then nothing follows.

    battery: charge left, 0..1. mocap_age, joint_age [s]: of the newest message by its stamp;
    mocap_still [s]: since the pose last was another one; mocap_position (3,): of the newest [m];
    controller_age [s]: of the oldest of the newest gains, which every controller tells;
    pose_controller_age: the same without the arm's. autopilot_age [s]: since the bridge last told
    that it hears the autopilot; round_trip [s]: how long the autopilot's answers take.
    missed_ticks: within the last second. temperature: of the hottest servo [deg C]. joint_effort
    (2,): measured [N m]. gains (3,): largest adapted gain of position, attitude, arm.
    """

    battery: float = math.nan
    mocap_age: float = math.nan
    joint_age: float = math.nan
    controller_age: float = math.nan
    missed_ticks: float = math.nan
    temperature: float = math.nan
    joint_effort: np.ndarray = field(default_factory=lambda: np.full(2, math.nan))
    gains: np.ndarray = field(default_factory=lambda: np.full(3, math.nan))
    pose_controller_age: float = math.nan
    autopilot_age: float = math.nan
    mocap_still: float = math.nan
    round_trip: float = math.nan
    mocap_position: np.ndarray = field(default_factory=lambda: np.full(3, math.nan))


@dataclass
class Observation:
    """One tick.

    state, reference (3, 8): the estimate, and what was asked of it. ground: height at take-off [m].
    ready: nothing of the mission's own is in the way of a take-off. landing_due: the scenario's
    landing has begun. on_ground: low and slow now; touchdown: for long enough; overdue: should have
    been by now.
    """

    state: np.ndarray
    reference: np.ndarray
    ground: float = 0.0
    armed: bool = False
    ready: bool = False
    landing_due: bool = False
    on_ground: bool = False
    touchdown: bool = False
    overdue: bool = False
    readings: Readings = field(default_factory=Readings)
