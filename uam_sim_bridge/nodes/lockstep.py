"""The waits of a lockstep flight: for the answers of a tick, and for the recorder.

How long a node takes depends on the machine, so no wall time ends a wait. Every node takes its
messages and reports in /diagnostics once a second. If all have done so REPORTS times since the wait
began and an answer is still missing, a message was lost, or a node answers nothing. A process that
has ended or is stopped reports nothing; `uam fly` finds it by its state.
"""

import math
import time
from collections.abc import Callable, Collection

from uam_control.stamps import SECOND
from uam_msgs_py.node import wiring
from uam_msgs_py.node.base_node import StopSignal
from uam_msgs_py.node.executor import LeanExecutor
from uam_msgs_py.node.tunable import TunableNode
from uam_msgs_py.node.wiring import Connections
from uam_sim_bridge.nodes.plant_options import PlantParameters
from uam_sim_bridge.nodes.plant_topics import SETPOINT, Answers, RecorderProgress, suspected
from uam_sim_bridge.paced_clock import Patience

REPORTS = 10  # of each node; a tick needs one round of each of six nodes
SAY_AFTER = 3.0  # [s] of wall time until a wait is told
IN_TIME = 25  # complete ticks in a row after which the restart is finished
RECORDER_LAG = SECOND  # [ns] receive buffers have room for more, see config/dds/fastdds.xml
# [s], [ticks]: single samples of the autopilot's IMU may be lost. After these ticks time goes on at
# the pace of the wall clock: without it the bridge could not relate the clocks again.
IMU_WAIT, IMU_MISSING = 2.0, 3


class Awaited:
    """One wait at a time: `begin`, then `told` and `lost` while it lasts."""

    def __init__(
        self, reported: Connections, nodes: Collection[str], tell: Callable[[str], None]
    ) -> None:
        """reported: of the nodes; nodes: those that a tick needs; tell: called with whom the plant
        waits for, at most once a second."""
        self._reported, self._nodes, self._tell = reported, nodes, tell
        self.begin()

    def begin(self) -> None:
        """Begin a wait."""
        self._begun = time.monotonic()
        self._before: list[int] = []  # reports when it was told

    def told(self, whom: Callable[[], str]) -> None:
        """Tell whom the plant waits for, if it has waited for SAY_AFTER."""
        if time.monotonic() - self._begun > SAY_AFTER:
            self._before = self._before or self._counts()
            self._tell(whom())

    @property
    def lost(self) -> bool:
        """Whether every node has reported often enough since the wait was told."""
        before = self._before
        return bool(before) and all(
            now - then >= REPORTS for now, then in zip(self._counts(), before, strict=True)
        )

    def _counts(self) -> list[int]:
        return [self._reported.reports(node) for node in self._nodes]


class Restart:
    """`going_on`: whether ticks go on without late answers."""

    def __init__(self, longest: float) -> None:
        """longest [s of wall time]: duration after the announcement of a restart."""
        self._longest = longest
        self._seen = self._complete = 0
        self._patience: Patience | None = None

    @property
    def going_on(self) -> bool:
        """Whether a restart goes on: neither finished nor longer than allowed."""
        return self._patience is not None and not self._patience.over

    def look(self, announced: int) -> None:
        """Register the number of restarts announced so far."""
        if announced > self._seen:
            self._seen = announced
            self.begin(self._longest)

    def begin(self, longest: float) -> None:
        """Begin a restart now, for at most `longest` [s of wall time]."""
        self._complete = 0
        self._patience = Patience(longest)

    def tick(self, complete: bool) -> None:
        """Register a tick; complete: all answers were in time."""
        if self._patience is not None:
            self._complete = self._complete + 1 if complete else 0
            if self._complete >= IN_TIME:
                self._patience = None


class PlantStopped(RuntimeError):
    """The flight cannot go on; the text is one line and names the node that did not answer."""


class Lockstep:
    """Waits, and says for whom. `any_input_wakes`: the executor, else the setpoint alone, which is
    usually the last answer to arrive."""

    def __init__(
        self,
        node: TunableNode,
        executor: LeanExecutor,
        options: PlantParameters,
        stop: StopSignal,
        period: float,
        answers: Answers,
        recorded: RecorderProgress,
        awaited: Awaited,
    ) -> None:
        """period [s]: of the ticks."""
        self._node, self._executor, self._options = node, executor, options
        self._stop, self._period = stop, period
        self._answers, self._recorded, self._awaited = answers, recorded, awaited
        self.any_input_wakes = False
        self._limit = options.answer_timeout or math.inf  # [s] of a wait
        self._patience, self._restart = Patience(self._limit), Restart(self._limit)
        self._unanswered = 0  # ticks in a row without an answer

    def wait(self, stamp: int | None, begun: float, now: float) -> None:
        """Wait for the answers of a tick; without some of them where time goes on.

        stamp [ns]: of its IMU sample, None without one; begun [s]: wall time of its begin; now [s]:
        of the plant. Raises PlantStopped.
        """
        if not self.recorder_has_caught_up(RECORDER_LAG, self._limit):
            since = f"{self._recorded.until / SECOND:g} s"
            raise PlantStopped(f"nothing recorded since {since}; the recorder is silent")
        if self._stop.raised:
            return
        if stamp is None:
            if self._options.publish_imu:
                return
            if not self._answers.begun:
                self._spin_until(begun + self._period)
                return
        own_imu = stamp is not None
        if own_imu or not self._unanswered:
            self._patience = Patience(self._limit)
            self._awaited.begin()
        slack = 0.0 if self._unanswered >= IMU_MISSING and not own_imu else IMU_WAIT
        while missing := self._answers.missing(stamp):
            self.any_input_wakes = SETPOINT not in missing
            left = begun + self._period - time.monotonic()
            hurried = self._restart.going_on or not slack
            self._executor.spin_once(max(0.0, left) if hurried else 0.1)
            self._restart.look(self._answers.restarts)
            if self._stop.raised or (self._restart.going_on and left <= 0.0):
                break
            over = self._patience.over or self._awaited.lost
            self._awaited.told(lambda: f"{' and '.join(sorted(missing))}{suspected(missing)}")
            if not own_imu and left < -slack and not over:
                break  # samples of the autopilot's IMU may be lost or refused
            if over:
                if self._options.end_with_mission:
                    raise PlantStopped(self._no_answer(missing, now))
                self._node.get_logger().warning(
                    f"{self._no_answer(missing, now)}; time goes on without it"
                )
                self._restart.begin(math.inf)
        self._unanswered = self._unanswered + 1 if missing else 0
        self._restart.tick(complete=not missing)

    def _spin_until(self, end: float) -> None:
        """Serve messages until the wall time `end` [s]."""
        while (left := end - time.monotonic()) > 0.0 and not self._stop.raised:
            self._executor.spin_once(left)

    def recorder_has_caught_up(self, lag: int, patience: float) -> bool:
        """Wait until the recorder is at most `lag` [ns] behind; return False after `patience`.

        patience: longest wait [s of wall time].
        """
        waiting, until = Patience(patience), -1
        while self._options.recorded and not self._stop.raised:
            if self._node.stamp - self._recorded.until <= lag:
                break
            if self._recorded.until != until:
                until = self._recorded.until
                self._awaited.begin()
            if waiting.over or self._awaited.lost:
                return False
            self._awaited.told(lambda: wiring.RECORDER)
            self.any_input_wakes = True
            self._executor.spin_once(0.1)
        return True

    def _no_answer(self, missing: frozenset[str], now: float) -> str:
        limit = self._options.answer_timeout
        since = f"within {limit:g} s" if limit else f"in {REPORTS} reports of every node"
        what = f"no {' and no '.join(sorted(missing))} for t = {now:.3f} s"
        return f"{what} {since}{suspected(missing)}"
