"""Stage: scenario and supervisor. state + autopilot + supervisor's inputs → reference, magnet,
arming."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from uam_control.mission import Mission, MissionOutput
from uam_control.stages.supervisor_inputs import SupervisorInputs
from uam_control.stages.timing import Ticks, Timing
from uam_control.stamps import seconds
from uam_control.supervision import Readings, State

TOLD_BY = 200_000_000  # [ns] after which every stage has the status of a tick


class MissionStage:
    """Makes the reference one tick ahead, so that it waits for the state and not the state for it.

    `output`: what holds at the tick between `begin` and `advance`; `flying`: whether the reference
    of that tick is to be flown; `ahead` [ns]: the tick of the newest reference.
    """

    def __init__(self, mission: Mission, timing: Timing) -> None:
        self.mission = mission
        self.period = Ticks(timing).period
        self.inputs = SupervisorInputs(seconds(self.period))
        self.flying = False
        self.ahead = -1
        self._armed_since: float | None = None
        self._told: deque[tuple[int, bool, int | None, float]] = deque()
        self._readings = Readings()
        self._flown = -TOLD_BY  # [ns] newest reference that the mission has flown

    @property
    def output(self) -> MissionOutput:
        """What the mission has decided; see `MissionOutput`."""
        return self.mission.output

    def autopilot(
        self, stamp: int, connected: bool, armed_since: int | None, round_trip: float | None
    ) -> None:
        """Take the bridge's report of the tick `stamp` [ns]; it counts from the next tick on.

        armed_since [ns]: the tick at which the autopilot was first known armed, None while it is
        not; round_trip [s]: how long its answers take, None where not known.
        """
        trip = math.nan if round_trip is None else round_trip
        self._told.append((stamp, connected, armed_since, trip))

    def begin(self, stamp: int, state: np.ndarray) -> bool:
        """Begin the tick `stamp` [ns] with its state (3, SIZE).

        Returns whether its reference had to be made now, at the first tick or after a gap.
        """
        while self._told and self._told[0][0] < stamp:
            told, connected, since, round_trip = self._told.popleft()
            self._armed_since = None if since is None else seconds(since)
            if connected:
                self.inputs.inputs.autopilot(seconds(told), round_trip)
        self._readings = self.inputs.tick(stamp)
        if stamp == self.ahead:
            return False
        self._step(stamp, state)
        return True

    def advance(self, stamp: int, state: np.ndarray) -> None:
        """Make the reference of the tick after `stamp` [ns], with what `begin` was told."""
        self._step(stamp + self.period, state)

    def _step(self, stamp: int, state: np.ndarray) -> None:
        output = self.mission.step(seconds(stamp), state, self._armed_since, self._readings)
        self.flying = self._is_flown(stamp, output)
        self.ahead = stamp

    def _is_flown(self, stamp: int, output: MissionOutput) -> bool:
        """Whether the reference is to be flown: in a failsafe, until the bridge is told of it.

        The bridge ignores commands then. Idle commands that come before it is told would mean that
        the vehicle stands on the ground, and low in the air they would switch its motors off.
        """
        if output.flying:
            self._flown = stamp
            return True
        return output.state is State.FAILSAFE and stamp - self._flown < TOLD_BY
