"""The sequence of a flight: waiting, take-off, the scenario's phases, landing, landed, or
aborted."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uam_control.compiled import jit
from uam_control.coordinates import ARM
from uam_control.mission.scenario import Scenario
from uam_control.mission.trajectory import Trajectory, empty_reference
from uam_control.parameters import ParameterSet, number


@dataclass(frozen=True)
class MissionParameters(ParameterSet):
    """When the flight begins, ends, and is given up."""

    takeoff_delay: float = number(0.5, "from armed to take-off", "s", 0.0, 60.0)
    touchdown_height: float = number(0.05, "height that counts as on the ground", "m", 0.0, 0.5)
    touchdown_speed: float = number(0.10, "vertical speed that counts as at rest", "m/s", 0.0, 1.0)
    touchdown_time: float = number(0.3, "how long both must hold", "s", 0.0, 5.0)
    touchdown_timeout: float = number(8.0, "longest wait for touchdown", "s", 0.0, 60.0)
    settle_time: float = number(1.5, "from touchdown to the end", "s", 0.0, 60.0)
    position_error_max: float = number(1.5, "position error that ends the flight", "m", 0.1, 100.0)
    tilt_max: float = number(1.05, "tilt that ends the flight", "rad", 0.1, 3.2)


@dataclass
class MissionOutput:
    """What the mission wants at one tick.

    reference (3, 8), reused by the next step; flying: position and attitude are to be controlled;
    time: mission time [s], negative before take-off; arm: the autopilot is to be armed.
    """

    reference: np.ndarray
    flying: bool = False
    time: float = -1.0
    phase: str = "waiting"
    magnet: bool = False
    arm: bool = True
    done: bool = False
    abort_reason: str = ""


class Mission:
    """Steps through a scenario; plain states, no clock but the stamps it is given."""

    def __init__(self, scenario: Scenario, parameters: MissionParameters) -> None:
        self.scenario = scenario
        self.parameters = parameters
        self.output = MissionOutput(empty_reference())
        self.output.reference[0, ARM] = scenario.arm_start
        self._trajectory: Trajectory | None = None
        self._takeoff = self._ground = 0.0
        self._at_rest_since: float | None = None
        self._end: float | None = None

    def step(self, stamp: float, state: np.ndarray, armed_since: float | None) -> MissionOutput:
        """Return what holds at `stamp` [s].

        state: newest estimate (3, 8). armed_since: stamp at which the autopilot reported armed,
        None while it is not. Call it for every tick with the stamp of the tick to come.
        """
        output = self.output
        if self._end is not None:
            output.time = stamp - self._takeoff
            output.done = stamp >= self._end
        elif self._trajectory is None:
            if armed_since is not None and stamp >= armed_since + self.parameters.takeoff_delay:
                self._take_off(stamp, state)
        else:
            self._fly(stamp, state, armed_since)
        return output

    def abort(self, stamp: float, reason: str) -> None:
        """Give the flight up: motors off, and the reason kept."""
        self.output.abort_reason = reason
        self._stop(stamp, "aborted")

    def _take_off(self, stamp: float, state: np.ndarray) -> None:
        start = state[0].copy()
        start[3:5] = 0.0
        start[ARM] = self.scenario.arm_start
        self._takeoff, self._ground = stamp, start[2]
        self._trajectory = self.scenario.trajectory(start)
        self._reference(stamp)
        self.output.flying = True

    def _reference(self, stamp: float) -> None:
        time = stamp - self._takeoff
        output = self.output
        self._trajectory.write(time, output.reference)
        output.time = time
        output.phase = self.scenario.phase(time)
        output.magnet = self.scenario.magnet_on(time)

    def _fly(self, stamp: float, state: np.ndarray, armed_since: float | None) -> None:
        fault = self._fault(state, armed_since)
        if fault:
            self.abort(stamp, fault)
            return
        self._reference(stamp)
        landing, p = self.scenario.landing, self.parameters
        if self.output.time < landing.at + 0.5 * landing.duration:
            return
        if state[0, 2] < self._ground + p.touchdown_height and abs(state[1, 2]) < p.touchdown_speed:
            if self._at_rest_since is None:
                self._at_rest_since = stamp
            if stamp - self._at_rest_since >= p.touchdown_time:
                self._stop(stamp, "landed")
                return
        else:
            self._at_rest_since = None
        if self.output.time > landing.at + landing.duration + p.touchdown_timeout:
            self.abort(stamp, f"no touchdown within {p.touchdown_timeout:g} s")

    def _fault(self, state: np.ndarray, armed_since: float | None) -> str:
        p = self.parameters
        if armed_since is None:
            return "the autopilot disarmed in flight"
        error, tilt = deviation(state, self.output.reference)
        if not error < p.position_error_max:
            return f"position error {error:.2f} m exceeds {p.position_error_max:g} m"
        if not tilt < p.tilt_max:
            return f"tilt {math.degrees(tilt):.0f} deg exceeds {math.degrees(p.tilt_max):.0f} deg"
        return ""

    def _stop(self, stamp: float, phase: str) -> None:
        output = self.output
        output.flying = output.arm = output.magnet = False
        output.phase = phase
        self._end = stamp + self.parameters.settle_time


@jit
def deviation(state, reference):
    """Return the distance from the reference [m] and the tilt [rad]; NaN where the state is."""
    squared = 0.0
    for i in range(3):
        squared += (state[0, i] - reference[0, i]) ** 2
    cosine = math.cos(state[0, 3]) * math.cos(state[0, 4])
    return math.sqrt(squared), math.acos(min(1.0, max(-1.0, cosine)))
