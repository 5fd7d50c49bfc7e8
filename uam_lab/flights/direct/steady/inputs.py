"""Supervisor's inputs: messages are kept at every tick, and read 50 times a second."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uam_control.ages import BRIDGED
from uam_control.control.controllers import Controller
from uam_control.estimation.pose_clock import counts
from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import put
from uam_control.stages.supervisor_inputs import READ_PERIOD, SupervisorInputs
from uam_control.stamps import SECOND
from uam_control.supervision import inputs
from uam_control.supervision.inputs import (
    SUBSYSTEMS,
    take_ages,
    take_bias,
    take_gains,
    take_pose,
)

MOCAP, JOINTS, PAYLOAD, BIAS, LIFT, GAINS = range(6)  # kept messages; GAINS: of three controllers
KINDS = ("mocap", "joints", "payload", "IMU bias", "lift", *SUBSYSTEMS)


class InputArrays(NamedTuple):
    """The kept messages, and the arrays of the inputs.

    kept (8,): whether a message of each of KINDS waits, at (8,): its stamp, [ns] for the first
    three, else [s]; mocap (7,), payload (3,), effort (n,), bias (3,), lift (1,), gains: its values;
    watched: places of each controller's gains. clock, supervisor (1,): of `SupervisorInputs`.
    """

    kept: np.ndarray
    at: np.ndarray
    mocap: np.ndarray
    payload: np.ndarray
    effort: np.ndarray
    bias: np.ndarray
    lift: np.ndarray
    gains: tuple[np.ndarray, np.ndarray, np.ndarray]
    watched: tuple[np.ndarray, np.ndarray, np.ndarray]
    inputs: inputs.InputArrays
    clock: np.ndarray
    supervisor: np.ndarray


class KeptMessages:
    """The messages that `SupervisorInputs` keeps, in arrays while compiled ticks fly."""

    def __init__(
        self, kept: SupervisorInputs, controllers: Sequence[Controller], joints: int
    ) -> None:
        """controllers: of position, attitude and arm."""
        self._kept, self._joints = kept, joints
        self._names = [tuple(one.names) for one in controllers]
        self._waits, self._at = np.zeros(len(KINDS), dtype=np.bool_), np.zeros(len(KINDS))
        gains = tuple(np.zeros(len(names)) for names in self._names)
        sizes = 7, 3, joints, 3, 1  # as `InputArrays`
        self._values = (*(np.zeros(size) for size in sizes), gains)

    def arrays(self) -> InputArrays:
        """Return the arrays."""
        kept = self._kept
        watched = tuple(map(kept.inputs.watched, self._names))
        own = self._waits, self._at, *self._values, watched
        return InputArrays(*own, kept.inputs.arrays, kept.clock.memory, kept.memory)

    def load(self) -> bool:
        """Copy the messages into the arrays; return whether the next ticks may be compiled."""
        kept, messages = self._kept, self._kept.newest()
        known = kept.inputs.settled and len(kept.readings.joint_effort) == self._joints
        if not known or messages.keys() - set(KINDS):
            return False
        mocap, payload, effort, bias, lift, gains = self._values
        self._waits[:] = False
        for name, message in messages.items():
            kind = KINDS.index(name)
            self._waits[kind] = True
            if kind != LIFT:
                self._at[kind] = message[0]
            if kind == MOCAP:
                mocap[:3], mocap[3:] = message[1:]
            elif kind == JOINTS:
                effort[:] = message[3]
            elif kind == PAYLOAD:
                payload[:] = message[1]
            elif kind == BIAS:
                bias[:] = message[1]
            elif kind == LIFT:
                lift[:] = message[0]
            else:
                gains[kind - GAINS][:] = message[3]
        return True

    def store(self) -> None:
        """Keep the messages of the arrays."""
        kept, read = self._kept, self._kept.inputs
        mocap, payload, effort, bias, lift, gains = self._values
        kept.forget()
        for kind in np.flatnonzero(self._waits).tolist():
            name, at, unread = KINDS[kind], self._at.item(kind), np.full(7, math.nan)
            if kind == MOCAP:
                kept.keep(name, kept.mocap, (int(at), mocap[:3].copy(), mocap[3:].copy()))
            elif kind == JOINTS:
                kept.keep(name, kept.joints, (int(at), unread, unread, effort.copy()))
            elif kind == PAYLOAD:
                kept.keep(name, kept.payload, (int(at), payload.copy(), unread))
            elif kind == BIAS:
                kept.keep(name, read.accelerometer_bias, (at, bias.copy()))
            elif kind == LIFT:
                kept.keep(name, read.lift, (lift.item(),))
            else:
                values = gains[kind - GAINS].copy()
                kept.keep(name, read.gains, (at, name, self._names[kind - GAINS], values))


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
    m = a.supervisor[0]
    if stamp - m.read_at >= READ_PERIOD:
        m.read_at = stamp
        read_messages(a, stamp)
    a.inputs.readings[0].missed_ticks = 0.0
    take_ages(a.inputs, stamp / SECOND)


@borrowing
def read_messages(a: InputArrays, stamp: int) -> None:
    """Read the kept messages, as `Inputs` does; stamp [ns]: of the reading."""
    m, kept, at, inputs = a.inputs.numbers[0], a.kept, a.at, a.inputs
    if kept[MOCAP]:
        exposed = at[MOCAP] / SECOND
        if counts(a.clock, exposed, stamp / SECOND, BRIDGED):
            take_pose(inputs, exposed, a.mocap[:3], a.mocap[3:])
    if kept[JOINTS]:
        m.joints = at[JOINTS] / SECOND
        put(a.effort, inputs.known.effort)
    if kept[PAYLOAD]:
        m.payload = at[PAYLOAD] / SECOND
        put(a.payload, inputs.payload)
    if kept[BIAS]:
        take_bias(inputs, at[BIAS], a.bias)
    if kept[LIFT]:
        inputs.readings[0].lift = a.lift[0]
    if kept[GAINS]:
        take_gains(inputs, 0, at[GAINS], a.gains[0], a.watched[0])
    if kept[GAINS + 1]:
        take_gains(inputs, 1, at[GAINS + 1], a.gains[1], a.watched[1])
    if kept[GAINS + 2]:
        take_gains(inputs, 2, at[GAINS + 2], a.gains[2], a.watched[2])
    for kind in range(len(kept)):
        kept[kind] = False
