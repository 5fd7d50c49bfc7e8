"""Inputs of the supervisor at a tick: observation, readings, operator commands."""

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

import numpy as np

from uam_control.maths.memory import Number, record
from uam_control.settings.plain_members import plain_members
from uam_control.supervision.states import Event


@plain_members
class OperatorCommand(Enum):
    """Commands of the operator in flight; the value is the event. GOAL: leave the path."""

    HOLD = Event.HOLD
    RESUME = Event.RESUME
    LAND = Event.LAND
    DISARM = Event.DISARM
    GOAL = Event.GOAL


class Authority(NamedTuple):
    """Who has control of the vehicle."""

    released_to: str = ""  # who, in place of the companion; "": nobody
    landed: bool = False  # it stands on the ground, says the autopilot
    lands: bool = False  # the autopilot by itself: by its mode, or as far as known, silent
    failed: str = ""  # why the bridge flies no more, "" while it may
    stopped: bool = False  # a kill has ended the flight for good


NUMBERS = (
    *("battery", "temperature", "missed_ticks", "slower", "contradiction", "lift"),
    *("throttle", "mocap_age", "mocap_still", "joint_age", "payload_age"),
    *("controller_age", "pose_controller_age", "autopilot_age"),
    *("round_trip", "loop_delay", "stamp"),
)  # of the readings


class ReadingArrays(NamedTuple):
    """values: all NUMBERS; position (3,), effort (n,), gains (3,): see `Readings`."""

    values: np.ndarray
    position: np.ndarray
    effort: np.ndarray
    gains: np.ndarray


class Readings:
    """Readings besides state and reference; NaN means unknown and has no effect.

    stamp [s]: of the tick, and of its state. battery: state of charge 0..1. mocap_age, joint_age
    [s]: of the newest message, by its stamp; mocap_still [s]: since the last change of the pose;
    mocap_position (3,) [m]: of the newest pose;
    controller_age [s]: of the newest gains of each controller, the largest age;
    pose_controller_age [s]: the same without the arm controller. autopilot_age [s]: since the
    bridge last reported a connection to the autopilot; round_trip [s]: of the autopilot's link;
    loop_delay [s]: from a setpoint to the gyro's response.
    missed_ticks: within the last second. temperature: of the hottest servo [deg C]. joint_effort
    (n,): measured [N m], empty where not known. gains (3,): largest adapted gain of position,
    attitude, arm. payload_position (3,) [m]: grip point of the payload, by its newest mocap pose;
    payload_age [s]: of that pose. grip (2,): opening [m] and closing force [N] of fingers. lift
    [N]: filtered collective thrust; throttle: the same as sent, 0..1. contradiction [m/s^2]: of
    motion capture and IMU, the fast change of the accelerometer's estimated bias. slower: than the
    wall clock, 1 − real-time factor of a simulation. `values`: all NUMBERS.
    """

    vars().update({name: Number() for name in NUMBERS})

    def __init__(self, **known: float | np.ndarray) -> None:
        """known: by name; the others are unknown."""
        self.memory = record("", " ".join(NUMBERS))
        self.values = self.memory.view(np.float64)
        self.values[:] = math.nan
        self.joint_effort, self.gains = np.zeros(0), np.full(3, math.nan)
        self.mocap_position, self.payload_position = np.full((2, 3), math.nan)
        self.grip = np.full(2, math.nan)
        for name, value in known.items():
            setattr(self, name, value)

    @property
    def arrays(self) -> ReadingArrays:
        """What compiled functions use."""
        return ReadingArrays(self.values, self.mocap_position, self.joint_effort, self.gains)


@dataclass
class Observation:
    """One tick."""

    state: np.ndarray  # (3, 6 + n) estimate
    reference: np.ndarray  # (3, 6 + n)
    ground: float = 0.0  # [m] height at take-off
    armed: bool = False  # by the autopilot's report
    authority: Authority = Authority()
    ready: bool = False  # the mission allows the take-off
    landing_due: bool = False  # the scenario's landing has begun
    on_ground: bool = False  # low and slow now
    touchdown: bool = False  # on the ground for touchdown_time
    overdue: bool = False  # no touchdown in the allowed time
    off_path: bool = False  # a goal or trajectory replaces the scenario's path
    arrived: bool = False  # its end is reached
    above_stand: bool = False  # a level descent may come down on a stand
    end_mission: str = ""  # why the mission lands before its end
    readings: Readings = field(default_factory=Readings)
