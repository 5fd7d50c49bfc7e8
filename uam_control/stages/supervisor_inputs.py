"""Stage: inputs of the supervisor besides state and reference, read 50 times a second.

Messages arrive more often than the limits need them. This stage keeps the newest message of each
kind and reads it at the next reading. Ages are differences of stamps, so the delay of a message
has no effect.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from uam_control.ages import BRIDGED
from uam_control.estimation.pose_clock import counts, new_clock
from uam_control.maths.compiled import borrowing
from uam_control.maths.kept_tuple import bound
from uam_control.maths.memory import Number, put, record
from uam_control.stamps import SECOND
from uam_control.supervision import Inputs, Readings
from uam_control.supervision.inputs import (
    SUBSYSTEMS,
    InputArrays,
    take_ages,
    take_bias,
    take_gains,
    take_pose,
)

READ_PERIOD = 20_000_000  # [ns] of stamps between two readings
Kept = tuple[Callable[..., None], tuple, int]  # reader, its arguments, tick answered [ns]
# messages of stages; GAINS: of the first of three laws
MOCAP, JOINTS, PAYLOAD, GRIP, BIAS, LIFT, GAINS = range(7)
KINDS = GAINS + len(SUBSYSTEMS)


class StageArrays(NamedTuple):
    """Messages of stages by their kinds, and the arrays of the inputs."""

    waits: np.ndarray  # (KINDS,) whether a message is not read yet
    at: np.ndarray  # (KINDS,) [ns] its stamp
    values: np.ndarray  # (KINDS, m) pose; efforts; grip; lift [N], throttle; gains
    watched: tuple[np.ndarray, np.ndarray, np.ndarray]  # places with a limit
    inputs: InputArrays
    clock: np.ndarray  # (1,)
    numbers: np.ndarray  # (1,) of `SupervisorInputs`


class SupervisorInputs:
    """Keeps messages until the next reading."""

    _read_at = Number()

    def __init__(self, control_period: float) -> None:
        """control_period [s]: time between two ticks."""
        self.inputs = Inputs(control_period)
        self.readings = Readings()  # of the last tick
        self.clock = new_clock()  # (1,) of the poses
        self._kept: dict[str, list[Kept]] = {}
        self._joints, self._names = 0, []
        self.arrays: StageArrays | None = None  # what compiled functions use, None before `share`
        self.memory = record("read_at")  # [ns] tick of the last reading
        self._read_at = -READ_PERIOD

    def keep(self, name: str, read: Callable[..., None], message: tuple, answers: int = -1) -> None:
        """Keep the newest message of `name`; the next reading calls read(*message).

        answers [ns]: the tick of which the message is a result. It is used from the next tick on:
        the message of another process may arrive before or after the reading of the same tick.
        """
        before = self._kept.get(name, ())
        # the one before it may be read at a tick that is too early for the newest
        self._kept[name] = [*before[-1:], (read, message, answers)]

    def share(self, joints: int, names: Sequence[Sequence[str]]) -> None:
        """Make room for the messages of stages in this process, see `put`; joints: of the arm,
        names: of the gains of each of SUBSYSTEMS."""
        self._joints, self._names = joints, [tuple(own) for own in names]
        self._arrange()

    def _arrange(self) -> None:
        self.inputs.expect(self._joints)
        width = max(7, self._joints, *map(len, self._names))
        kept = np.zeros(KINDS, dtype=np.bool_), np.zeros(KINDS, dtype=np.int64)
        watched = tuple(map(self.inputs.watched, self._names))
        self.arrays = StageArrays(
            *(*kept, np.zeros((KINDS, width)), watched),
            *(self.inputs.arrays, self.clock, self.memory),
        )
        self._read = bound(read_messages, self.arrays, 0)

    def put(self, kind: int, stamp: int, *values: np.ndarray) -> None:
        """Keep the newest message of a stage in this process, of a kind from MOCAP on.

        stamp [ns], values: see `StageArrays`; as `keep` does for any message.
        """
        kept, begin = self.arrays, 0
        kept.waits[kind], kept.at[kind] = True, stamp
        for part in values:
            kept.values[kind, begin : begin + len(part)] = part
            begin += len(part)

    @property
    def settled(self) -> bool:
        """Whether only messages of stages wait, and no other value changes; see `Inputs`."""
        return self.arrays is not None and not self._kept and self.inputs.settled

    def begin_anew(self) -> None:
        """Forget all values: stamps of a new simulation follow."""
        self.inputs.begin_anew()
        self.readings = Readings()
        self.clock = new_clock()
        self._kept.clear()
        if self.arrays is not None:
            self._arrange()

    def mocap(self, stamp: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Read a pose of `stamp` [ns]: position (3,) [m, ENU], quaternion (4,) [w x y z].

        One that does not count is none: from the future, its age would never
        reach a limit; too late, or of a wrong clock, the estimate does not use it.
        """
        if counts(self.clock, stamp / SECOND, self._read_at / SECOND, BRIDGED):
            self.inputs.mocap(stamp / SECOND, position, quaternion)

    def payload(self, stamp: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Read a pose of the payload's grip point, as `mocap` does."""
        self.inputs.payload(stamp / SECOND, position)

    def tick(self, stamp: int) -> Readings:
        """Return the readings at the tick `stamp` [ns]; the next call reuses the object."""
        if stamp - self._read_at >= READ_PERIOD or stamp < self._read_at:
            self._read_at = stamp
            if self.arrays is not None:
                self._read(stamp)
            kept, self._kept = self._kept, {}
            for name, messages in kept.items():
                early = [one for one in messages if one[2] >= stamp]
                if early:
                    self._kept[name] = early
                if len(early) < len(messages):
                    read, message, _ = messages[-1 - len(early)]
                    read(*message)
        self.readings = self.inputs.at(stamp / SECOND)
        return self.readings


@borrowing
def keep(a: StageArrays, kind: int, stamp: int, values: np.ndarray) -> None:
    """See `SupervisorInputs.put`; of longer values the first count."""
    a.waits[kind], a.at[kind] = True, stamp
    for i in range(min(len(values), a.values.shape[1])):
        a.values[kind, i] = values[i]


@borrowing
def read_inputs(a: StageArrays, stamp: int) -> None:
    """Do what `SupervisorInputs.tick` does at `stamp` [ns] with the messages of stages alone."""
    m = a.numbers[0]
    if stamp - m.read_at >= READ_PERIOD:
        m.read_at = stamp
        read_messages(a, stamp)
    a.inputs.readings[0].missed_ticks = 0.0
    take_ages(a.inputs, stamp / SECOND)


@borrowing
def read_messages(a: StageArrays, stamp: int) -> None:
    """Read the messages of stages, as `Inputs` does; stamp [ns]: of the reading."""
    m, waits, at, values, inputs = a.inputs.numbers[0], a.waits, a.at, a.values, a.inputs
    if waits[MOCAP]:
        exposed = at[MOCAP] / SECOND
        if counts(a.clock, exposed, stamp / SECOND, BRIDGED):
            take_pose(inputs, exposed, values[MOCAP, :3], values[MOCAP, 3:7])
    if waits[JOINTS]:
        m.joints = at[JOINTS] / SECOND
        put(values[JOINTS], inputs.known.effort)
    if waits[PAYLOAD]:
        m.payload = at[PAYLOAD] / SECOND
        put(values[PAYLOAD], inputs.payload)
    if waits[GRIP]:
        put(values[GRIP], inputs.grip)
    if waits[BIAS]:
        take_bias(inputs, at[BIAS] / SECOND, values[BIAS, :3])
    if waits[LIFT]:
        inputs.readings[0].lift = values[LIFT, 0]
        inputs.readings[0].throttle = values[LIFT, 1]
    for i in range(len(a.watched)):
        if waits[GAINS + i]:
            take_gains(inputs, i, at[GAINS + i] / SECOND, values[GAINS + i], a.watched[i])
    for kind in range(KINDS):
        waits[kind] = False
