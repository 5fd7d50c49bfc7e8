"""Supervisor's inputs: messages are kept at every tick, and read 50 times a second."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from uam_control.ages import BRIDGED, STALE, usable
from uam_control.control.controllers import Controller
from uam_control.estimation.repeats import repeated
from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import numbers, put, record
from uam_control.stages.supervisor_inputs import READ_PERIOD, SupervisorInputs
from uam_control.stamps import SECOND
from uam_control.supervision.checks import CHECKS, readings_of
from uam_control.supervision.inputs import (
    SUBSYSTEMS,
    follow_bias,
    largest_of,
)

_NAMES = [check.reading for check in CHECKS if check.reading]  # as `readings_of`
_MOCAP_AGE, _STILL, _JOINT_AGE, _AUTOPILOT_AGE, _CONTROLLER_AGE, _CONTRADICTION, _MISSED = (
    _NAMES.index(name)
    for name in (
        *("mocap_age", "mocap_still", "joint_age", "autopilot_age"),
        *("controller_age", "contradiction", "missed_ticks"),
    )
)
_delays = attrgetter("round_trip", "loop_delay", "lift")
MOCAP, JOINTS, PAYLOAD, BIAS, LIFT, GAINS = range(6)  # kept messages; GAINS: of three controllers
KINDS = ("mocap", "joints", "payload", "IMU bias", "lift", *SUBSYSTEMS)


class InputArrays(NamedTuple):
    """State of the inputs.

    kept (8,): whether a message of each of KINDS waits, at (8,): its stamp, [ns] for the first
    three, else [s]; mocap (7,), payload (3,), effort (n,), bias (3,), gains: its values. read_*:
    the values that were read. bias_mean (3,); newest (7,): pose before; watched: of each
    controller's gains. values: of `readings_of`; largest (3,): of the gains.
    """

    kept: np.ndarray
    at: np.ndarray
    mocap: np.ndarray
    payload: np.ndarray
    effort: np.ndarray
    bias: np.ndarray
    gains: tuple[np.ndarray, np.ndarray, np.ndarray]
    read_position: np.ndarray
    read_payload: np.ndarray
    read_effort: np.ndarray
    bias_mean: np.ndarray
    newest: np.ndarray
    watched: tuple[np.ndarray, np.ndarray, np.ndarray]
    values: np.ndarray
    largest: np.ndarray
    memory: np.ndarray


WHOLE = "read_at bias_known"
REAL = (
    "lift_kept mocap joints autopilot payload moved last bias_first bias_last "
    "position attitude arm oldest oldest_of_pose payload_age pose_controller_age "
    "round_trip loop_delay lift"
)
_LAST, _LIFT, _PAYLOAD_AGE = (
    (*WHOLE.split(), *REAL.split()).index(name) for name in ("last", "lift", "payload_age")
)


class InputsPart:
    """The part of `SupervisorInputs`."""

    def __init__(
        self, kept: SupervisorInputs, controllers: Sequence[Controller], joints: int
    ) -> None:
        """controllers: of position, attitude and arm."""
        self._kept, self._joints = kept, joints
        self._names = [tuple(one.names) for one in controllers]
        self._gains = [np.zeros(len(names)) for names in self._names]
        self.arrays: InputArrays | None = None

    def load(self) -> bool:
        """Copy the state into the arrays; return whether its ticks may be steady."""
        inputs = self._kept.inputs
        readings = inputs._readings
        messages = {name: all_of_it[-1] for name, all_of_it in self._kept._kept.items()}
        ready = (
            not inputs._gaps
            and inputs._last is not None
            and len(inputs._controllers) == len(SUBSYSTEMS)
            and all(names in inputs._watched for names in self._names)
            and len(readings.joint_effort) == self._joints
            and self._kept.readings is readings
            and messages.keys() <= set(KINDS)
            and readings.missed_ticks == 0.0
        )
        if not ready:
            return False
        if self.arrays is None:
            self._allocate()
        a = self.arrays
        a.kept[:] = False
        lift = math.nan
        for name, (_, message, _) in messages.items():
            kind = KINDS.index(name)
            a.kept[kind] = True
            if kind == MOCAP:
                a.at[kind] = message[0]
                a.mocap[:3], a.mocap[3:] = message[1:]
            elif kind == JOINTS:
                a.at[kind], a.effort[:] = message[0], message[3]
            elif kind == PAYLOAD:
                a.at[kind], a.payload[:] = message[:2]
            elif kind == BIAS:
                a.at[kind], a.bias[:] = message
            elif kind == LIFT:
                lift = message[0]
            else:
                a.at[kind], a.gains[kind - GAINS][:] = message[0], message[3]
        a.read_position[:] = readings.mocap_position
        a.read_payload[:] = readings.payload_position
        a.read_effort[:] = readings.joint_effort
        a.bias_mean[:] = inputs._bias_mean
        a.values[:] = readings_of(readings)
        a.largest[:] = readings.gains
        bias, controllers = inputs._bias, inputs._controllers
        a.memory[0] = (
            *(self._kept._read_at, bias is not None),
            *(lift, inputs._mocap, inputs._joints, inputs._autopilot, inputs._payload),
            *(inputs._moved, inputs._last, *(bias or (math.nan, math.nan))),
            *(controllers[name] for name in SUBSYSTEMS),
            *(inputs._oldest, inputs._oldest_of_pose),
            *(readings.payload_age, readings.pose_controller_age, *_delays(readings)),
        )
        return True

    def _allocate(self) -> None:
        inputs = self._kept.inputs
        n = self._joints
        self.arrays = InputArrays(
            np.zeros(len(KINDS), dtype=np.bool_),
            np.zeros(len(KINDS)),
            *(np.zeros(7), np.zeros(3), np.zeros(n), np.zeros(3)),
            tuple(self._gains),
            *(np.zeros(3), np.zeros(3), np.zeros(n), np.zeros(3), inputs._repeats.newest),
            tuple(inputs._watched[names] for names in self._names),
            *(np.zeros(len(_NAMES)), np.zeros(3), record(WHOLE, REAL)),
        )

    def store(self) -> None:
        """Copy the state back."""
        kept, inputs, a = self._kept, self._kept.inputs, self.arrays
        m = numbers(a.memory)
        self._store_messages(m["lift_kept"])
        kept._read_at = kept._now = m["read_at"]
        self.store_readings()
        readings = inputs._readings
        for name, value in zip(_NAMES, a.values.tolist(), strict=True):
            setattr(readings, name, value)
        readings.mocap_position[:] = a.read_position
        readings.gains[:] = a.largest
        readings.pose_controller_age = m["pose_controller_age"]
        readings.round_trip, readings.loop_delay = m["round_trip"], m["loop_delay"]
        inputs._autopilot = m["autopilot"]
        inputs._mocap, inputs._joints, inputs._payload = m["mocap"], m["joints"], m["payload"]
        inputs._moved, inputs._last = m["moved"], m["last"]
        inputs._bias = (m["bias_first"], m["bias_last"]) if m["bias_known"] else None
        inputs._bias_mean[:] = a.bias_mean
        for name in SUBSYSTEMS:
            inputs._controllers[name] = m[name]
            if name in inputs._of_pose:
                inputs._of_pose[name] = m[name]
        inputs._oldest, inputs._oldest_of_pose = m["oldest"], m["oldest_of_pose"]

    def report(self, stamp: int, delays: tuple[float | None, float | None]) -> None:
        """Take the report of the tick `stamp` [ns], as `Inputs.autopilot` does; delays [s]: of the
        link and of the loop."""
        round_trip, loop_delay = (math.nan if one is None else one for one in delays)
        m = self.arrays.memory
        m["autopilot"], m["round_trip"], m["loop_delay"] = stamp / SECOND, round_trip, loop_delay

    def store_readings(self) -> None:
        """Copy back the readings that the executive of the grasps uses."""
        a, readings = self.arrays, self._kept.inputs._readings
        m = a.memory[0].item()
        readings.stamp, readings.lift, readings.payload_age = m[_LAST], m[_LIFT], m[_PAYLOAD_AGE]
        readings.payload_position[:] = a.read_payload
        readings.joint_effort = a.read_effort.copy()

    def _store_messages(self, lift: float) -> None:
        kept, inputs, a = self._kept, self._kept.inputs, self.arrays
        kept._kept = {}
        for kind in np.flatnonzero(a.kept).tolist():
            at = a.at.item(kind)
            if kind == MOCAP:
                read, message = kept.mocap, (int(at), a.mocap[:3].copy(), a.mocap[3:].copy())
            elif kind == JOINTS:
                unread = np.full(self._joints, math.nan)
                read, message = kept.joints, (int(at), unread, unread, a.effort.copy())
            elif kind == PAYLOAD:
                read, message = kept.payload, (int(at), a.payload.copy(), np.full(4, math.nan))
            elif kind == BIAS:
                read, message = inputs.accelerometer_bias, (at, a.bias.copy())
            elif kind == LIFT:
                read, message = inputs.lift, (lift,)
            else:
                gains, names = a.gains[kind - GAINS].copy(), self._names[kind - GAINS]
                read, message = inputs.gains, (at, KINDS[kind], names, gains)
            kept._kept[KINDS[kind]] = [(read, message, -1)]  # of a tick that is over


@borrowing
def keep_gains(a: InputArrays, controller: int, stamp: int, values: np.ndarray) -> None:
    """Keep the gains of a controller, 0..2, the first of values, at the tick `stamp` [ns]."""
    a.kept[GAINS + controller] = True
    a.at[GAINS + controller] = stamp / SECOND
    for i in range(3):  # a tuple of arrays of different lengths
        if i == controller:
            for j in range(len(a.gains[i])):
                a.gains[i][j] = values[j]


@borrowing
def read_inputs(a: InputArrays, stamp: int) -> None:
    """Do what `SupervisorInputs.tick` does at `stamp` [ns]."""
    m = a.memory[0]
    if stamp - m.read_at >= READ_PERIOD:
        m.read_at = stamp
        read_messages(a, stamp)
    now = stamp / SECOND
    m.last = now
    if m.bias_known and now - m.bias_last > STALE:
        a.values[_CONTRADICTION] = math.nan
    a.values[_MOCAP_AGE] = now - m.mocap
    a.values[_STILL] = now - m.moved
    a.values[_JOINT_AGE] = now - m.joints
    a.values[_AUTOPILOT_AGE] = now - m.autopilot
    m.payload_age = now - m.payload
    a.values[_CONTROLLER_AGE] = now - m.oldest
    m.pose_controller_age = now - m.oldest_of_pose
    a.values[_MISSED] = 0.0


@borrowing
def read_messages(a: InputArrays, stamp: int) -> None:
    """Read the kept messages, as `Inputs` does; stamp [ns]: of the reading."""
    m, kept, at = a.memory[0], a.kept, a.at
    if kept[MOCAP] and usable((stamp - at[MOCAP]) / SECOND, BRIDGED):
        m.mocap = at[MOCAP] / SECOND
        position, quaternion = a.mocap[:3], a.mocap[3:]
        put(position, a.read_position)
        if not repeated(position, quaternion, a.newest):
            m.moved = m.mocap
    if kept[JOINTS]:
        m.joints = at[JOINTS] / SECOND
        put(a.effort, a.read_effort)
    if kept[PAYLOAD]:
        m.payload = at[PAYLOAD] / SECOND
        put(a.payload, a.read_payload)
    if kept[BIAS]:
        if not m.bias_known:
            m.bias_known, m.bias_first, m.bias_last = 1, at[BIAS], at[BIAS]
            put(a.bias, a.bias_mean)
        away = follow_bias(at[BIAS], m.bias_first, m.bias_last, a.bias, a.bias_mean)
        m.bias_last = at[BIAS]
        a.values[_CONTRADICTION] = away
    if kept[LIFT]:
        m.lift = m.lift_kept
    if kept[GAINS]:
        a.largest[0] = largest_of(a.gains[0], a.watched[0])
        m.position = at[GAINS]
    if kept[GAINS + 1]:
        a.largest[1] = largest_of(a.gains[1], a.watched[1])
        m.attitude = at[GAINS + 1]
    if kept[GAINS + 2]:
        a.largest[2] = largest_of(a.gains[2], a.watched[2])
        m.arm = at[GAINS + 2]
    m.oldest = min(m.position, m.attitude, m.arm)
    m.oldest_of_pose = min(m.position, m.attitude)
    for kind in range(len(kept)):
        kept[kind] = False
