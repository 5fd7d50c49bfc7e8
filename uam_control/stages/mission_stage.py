"""Stage: mission and supervisor. state + autopilot + limits' inputs → reference, magnet, arming."""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from uam_control.maths.compiled import borrowing
from uam_control.maths.memory import Number, record
from uam_control.mission import Mission
from uam_control.mission.guidance import MOST
from uam_control.mission.mission import MissionArrays, follow_scenario
from uam_control.stages.autopilot_port import AutopilotReport
from uam_control.stages.law_stages import REPORT_DELAY
from uam_control.stages.supervisor_inputs import SupervisorInputs
from uam_control.stages.tick_stamps import Timing, carried, serves
from uam_control.stamps import NEW_TIME, SECOND
from uam_control.supervision import Authority, Readings, State
from uam_control.supervision.observation import ReadingArrays


class StageArrays(NamedTuple):
    """Of the mission; numbers (1,): memory of a `MissionStage`."""

    mission: MissionArrays
    numbers: np.ndarray


class MissionStage:
    """Computes the reference one tick ahead, so that it is ready when the state arrives.

    Between `begin` and `advance`, `output` is the mission's output at this tick, see
    `MissionOutput`, `flying` is whether the controllers fly its reference, `reference`
    (3, 6 + n) what they fly, see `ahead`, and `time` the mission time [s]. `ahead` [ns]: the stamp
    of the newest reference. While the mission only follows its scenario, compiled functions do the
    same: `begin_tick` and `advance` of this module, on `arrays`.
    """

    time, ahead, period = Number(), Number(), Number()
    _last, _flown = Number(), Number()

    def __init__(self, mission: Mission, timing: Timing) -> None:
        self.mission, self.output = mission, mission.output
        # [ns]: last: the tick before; flown: newest reference that the mission has flown
        self.memory = record("ahead last period flown", "time")
        self.period = timing.period
        self.inputs = SupervisorInputs(self.period / SECOND)
        self.flying = self.anew = False
        self.reference, self.time = self.output.reference, self.output.time
        self.ahead = self._last = -1
        self._armed_since: float | None = None
        self._reports: deque[tuple[int, AutopilotReport]] = deque()  # and stamps [ns]
        self._authority = Authority()
        self._readings = Readings()
        self._flown = -REPORT_DELAY

    def autopilot(self, stamp: int, report: AutopilotReport) -> None:
        """Take the bridge's report of the tick `stamp` [ns]; it is used from the next tick on.

        A message's `AutopilotState` has the same entries.
        """
        self._reports.append((stamp, report))

    def begin(self, stamp: int, state: np.ndarray) -> None:
        """Start the tick `stamp` [ns] with its state (3, 6 + n), see `coordinates`.

        The reference of this tick is computed `anew` at the first tick, and where the newest one
        does not serve it.
        """
        if stamp < self.ahead - NEW_TIME:
            self._begin_anew()
        self.take_reports(stamp)
        self._readings = self.inputs.tick(stamp)
        last, self._last = self._last, stamp
        serving = stamp == self.ahead or serves(self.ahead, last, stamp, self.period)
        self.anew = not serving  # whether the reference of this tick was computed in it
        if self.anew:
            self.advance(stamp - self.period, state)
        output, step = self.output, stamp - self.ahead
        self.reference = carried(output.reference, step) if step else output.reference
        self.time = output.time + step / SECOND if output.time >= 0.0 else output.time

    def take_reports(self, stamp: int) -> None:
        """Use the bridge's reports of the ticks before `stamp` [ns]."""
        while self._reports and self._reports[0][0] < stamp:
            reported, r = self._reports.popleft()
            self._authority = Authority(r.released_to, r.landed, r.lands, r.failed, r.stopped)
            if r.connected:  # else a new bridge may not have heard of it yet
                armed = r.armed and r.armed_since is not None
                self._armed_since = r.armed_since / SECOND if armed else None
                delays = (r.round_trip, r.loop_delay)
                known = (math.nan if one is None else one for one in delays)
                self.inputs.inputs.autopilot(reported / SECOND, *known)

    def _begin_anew(self) -> None:
        """Forget the flight: stamps went back, the simulation is a new one."""
        self.mission.begin_anew()
        self.inputs.begin_anew()
        self._reports.clear()
        self._last = -1
        self._armed_since, self._authority = None, Authority()
        self._flown = -REPORT_DELAY

    def advance(self, stamp: int, state: np.ndarray) -> None:
        """Compute the reference of the tick after `stamp` [ns], with the inputs of `begin`.

        state: (3, 6 + n) of the tick `stamp`.
        """
        ahead = self.ahead = stamp + self.period
        output = self.mission.step(
            ahead / SECOND, state, self._armed_since, self._readings, self._authority
        )
        if output.flying:
            self._flown = ahead
        # In a failsafe the bridge ignores commands. Idle commands mean that the vehicle is on the
        # ground. If they arrived before the status, they would switch off the motors at low height.
        failing = output.state is State.FAILSAFE and ahead - self._flown < REPORT_DELAY
        self.flying = output.flying or failing

    def nominal(self, stamp: int) -> bool:
        """Return whether the ticks after `stamp` [ns], the newest one with a state, may be compiled
        until a value or a message demands a decision."""
        following = stamp + self.period
        if self.ahead != following or self._last != stamp:
            return False
        self.take_reports(following)
        by = self._authority
        held = by.released_to or by.failed or by.lands or by.stopped
        known = self.flying and self._armed_since is not None and not (self._reports or held)
        return known and self.inputs.settled and self.mission.nominal

    def look_ahead(self, most: int) -> int:
        """Make ready for at most `most` compiled ticks; return for how many."""
        count = min(most, MOST)
        return self.mission.look_ahead(
            (self.ahead + self.period * np.arange(1, count + 1)) / SECOND
        )

    @property
    def arrays(self) -> StageArrays:
        """What the compiled ticks of a flight use."""
        return StageArrays(self.mission.arrays, self.memory)

    def resume(self, state: np.ndarray) -> None:
        """Go on after compiled ticks, the last one with state (3, 6 + n)."""
        self.mission.resume(state, self._authority)


@borrowing
def begin_tick(a: StageArrays, stamp: int) -> None:
    """Do what `MissionStage.begin` does at the tick `stamp` [ns] that `advance` has made ready."""
    m, mission = a.numbers[0], a.mission.numbers[0]
    m.last, m.time = stamp, mission.stamp - mission.takeoff


@borrowing
def advance(a: StageArrays, readings: ReadingArrays, stamp: int, state: np.ndarray) -> bool:
    """Do what `MissionStage.advance` does at `stamp` [ns].

    Returns False, and changes nothing, where something is to be decided.
    """
    m = a.numbers[0]
    ahead = stamp + m.period
    if not follow_scenario(a.mission, readings, ahead / SECOND, state):
        return False
    m.ahead = ahead
    m.flown = ahead
    return True
