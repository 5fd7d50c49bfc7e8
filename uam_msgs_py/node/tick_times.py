"""Where the time of a node's ticks goes: monotonic times at the edges of each tick.

A node with the parameter `tick_times` measures. `lap(part)` adds the time since the last lap to a
part of the tick, so that every moment belongs to exactly one part. At the end of a tick its times
become one row of a table that was allocated before the flight; at the end of the node the table is
written to a file. Without the parameter `NoTickTimes` stands here, whose methods do nothing.

The times are those of CLOCK_MONOTONIC, which all processes of a machine share: the wake-up of a
node is the time from the publication of the message that it waits for, in another process, until
its wait returns. `uam budget` computes it from the rows of all nodes (docs/tick_budget.md).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.publisher import Publisher

from uam_control.settings.atomic import replacing
from uam_control.settings.process_parameters import TickTimesParameters
from uam_msgs_py.messages import topics

TAKE, DECODE, STAGE, ENCODE, PUBLISH = range(5)
_LAST = [0]  # [ns] newest lap in this process: nodes that share it do not count a moment twice
_OPEN: list[TickTimes] = []  # the measurements of this process
PARTS = ("take", "decode", "stage", "encode", "publish")
# [ns] stamp: of the tick; woken: the wait returned; sending, sent: before and after the publication
# of the tick's result; done: end of the tick; then the parts of the tick since `woken`, the parts
# until `sending`, and the work since the last tick that was done before `woken`.
COLUMNS = (
    *("stamp", "woken", "sending", "sent", "done"),
    *PARTS,
    *(f"{part} until sending" for part in PARTS),
    "before",
)
# topics whose publication is the result of a node's tick; the last one counts before the others
RESULTS = (
    *(topics.IMU, topics.STATE, topics.REFERENCE, topics.POSITION_COMMAND),
    *(topics.ATTITUDE_COMMAND, topics.ARM_EFFORT, topics.SETPOINT),
)


class NoTickTimes:
    """Measures nothing: for the methods see TickTimes."""

    def lap(self, *_: object) -> None:
        """Do nothing."""

    rest = woken = tick = watch = close = lap

    def measured(self, send: Callable[[], None]) -> Callable[[], None]:
        """Return `send` itself."""
        return send


class TickTimes(NoTickTimes):
    """The times of the newest `kept` ticks, written to `file` by `close`."""

    def __init__(self, file: Path, kept: int):
        self._file = file
        self._rows = np.zeros((kept, len(COLUMNS)), dtype=np.int64)
        self._rows[:] = 1  # touches every page now, not in flight
        self._count = 0
        self._before = 0  # [ns] of work since the last tick, before `woken`
        _OPEN.append(self)
        self._begin(time.monotonic_ns())

    def lap(self, part: int) -> None:
        """Add the time since the last lap to a part of the tick."""
        now = time.monotonic_ns()
        self._spent[part] += now - _LAST[0]
        _LAST[0] = now

    def rest(self) -> None:
        """Begin to wait: the time since the last lap belongs to no part of a tick."""
        now = time.monotonic_ns()
        self._before += now - _LAST[0]
        _LAST[0] = now

    def woken(self) -> None:
        """End a wait: what was done since the last tick was before this wake-up."""
        self._before += sum(self._spent)
        self._begin(time.monotonic_ns())

    def _begin(self, now: int) -> None:
        self._spent = [0] * len(PARTS)  # [ns] since `woken`
        self._until = [0] * len(PARTS)  # [ns] of these until `sending`
        self._sending = self._sent = 0
        self._rank = -1  # of the published result, in RESULTS
        _LAST[0] = self._woken = now

    def tick(self, stamp: int) -> None:
        """End the tick `stamp` [ns]; the time since the last lap belongs to its encoding."""
        self.lap(ENCODE)
        spent, until = self._spent, self._until
        times = (stamp, self._woken, self._sending, self._sent, _LAST[0])
        self._rows[self._count % len(self._rows)] = (*times, *spent, *until, self._before)
        self._count += 1
        self._begin(_LAST[0])  # of a tick that may follow in the same wake-up
        self._before = 0

    def watch(self, publisher: Publisher, topic: topics.Topic) -> None:
        """Measure the publications of `topic`: from now on `publisher.publish` takes laps."""
        rank = RESULTS.index(topic) if topic in RESULTS else -1
        publish = publisher.publish

        def measured(message: Any) -> None:
            self.lap(ENCODE)
            sending = _LAST[0]
            publish(message)
            self.lap(PUBLISH)
            if rank > self._rank:
                self._rank, self._sending, self._sent = rank, sending, _LAST[0]
                self._until[:] = self._spent
                self._until[PUBLISH] -= _LAST[0] - sending

        publisher.publish = measured

    def measured(self, send: Callable[[], None]) -> Callable[[], None]:
        """Return `send` as a publication of the tick's result, in a process with several nodes.

        Their parts until then are those of each node whose tick is not over yet.
        """

        def sending() -> None:
            self.lap(ENCODE)
            begun = _LAST[0]
            for one in _OPEN:
                one._until[:] = one._spent
            send()
            self.lap(PUBLISH)
            self._sending, self._sent = begun, _LAST[0]

        return sending

    def close(self) -> None:
        """Write the rows, oldest first."""
        _OPEN.remove(self)
        kept = len(self._rows)
        first = self._count % kept if self._count > kept else 0
        rows = np.roll(self._rows, -first, axis=0)[: min(self._count, kept)]
        with replacing(self._file) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, columns=np.array(COLUMNS), rows=rows)


def tick_times(parameters: TickTimesParameters) -> NoTickTimes:
    """Return the measurement that the parameters request."""
    if not parameters.tick_times:
        return NoTickTimes()
    return TickTimes(Path(parameters.tick_times), parameters.tick_times_kept)


def read_tick_times(file: Path) -> dict[str, np.ndarray]:
    """Return column → values (ticks,) [ns] of a file by `TickTimes.close`."""
    with np.load(file) as content:
        return dict(zip(content["columns"].tolist(), content["rows"].T, strict=True))
