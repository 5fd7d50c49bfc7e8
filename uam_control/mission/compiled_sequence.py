"""The sequence of a flight for compiled ticks: when they may step it, and on which arrays."""

from __future__ import annotations

import math

import numpy as np

from uam_control.mission.commanded_flight import CommandedFlight
from uam_control.mission.mission_parameters import MissionParameters
from uam_control.mission.nominal_tick import MissionArrays
from uam_control.supervision import Authority, Guide, State

FOLLOWS = (State.TAKING_OFF, State.FLYING, State.LANDING)  # states that follow the scenario


class Mission(CommandedFlight):
    """The sequence; while it only follows its scenario, compiled functions step it.

    `arrays`: what they use, None before a flight.
    """

    def _begin(self, parameters: MissionParameters) -> None:
        super()._begin(parameters)
        self.arrays: MissionArrays | None = None

    def _arrange(self) -> None:
        """Collect the arrays of a flight."""
        supervisor, m, p = self._supervisor, self.memory, self._parameters
        m["height"], m["speed"] = p.touchdown_height, p.touchdown_speed
        m["half"] = self.scenario.landing.half
        self.arrays = MissionArrays(
            *(self._guidance.arrays, supervisor.checks.arrays),
            *(supervisor.memory, self._watch.memory, m),
        )

    @property
    def nominal(self) -> bool:
        """Whether the next steps only follow the scenario, until a value or a message demands more:
        then `follow_scenario` does them, see `look_ahead`."""
        output, supervisor, guidance = self.output, self._supervisor, self._guidance
        decision = supervisor.decision
        ended = self._over or output.done or self._end is not None
        return (
            guidance is not None
            and output.state in FOLLOWS
            and output.flying
            and decision.guide is Guide.SCENARIO
            and decision is self._followed
            and supervisor.calm
            and guidance.on_path(self._stamp)
            and self._watch.settled
            and self._touchdown.idle
            and not (ended or self._requests or self._override.given)
            and self._standing is None
            and self._descent is None
            and self._beside is None
            and self._magnet_on(decision) == output.magnet
            and self._phase(decision) == output.phase
        )

    def look_ahead(self, stamps: np.ndarray) -> int:
        """Compute the path at the next stamps (m,) [s], at most `guidance.MOST`, while `nominal`.

        Returns for how many of them nothing of the scenario changes.
        """
        landing, state = self.scenario.landing, self.output.state
        lands = state is State.LANDING
        until = landing.end + self._parameters.touchdown_timeout if lands else landing.at
        self.memory["takes_off"] = state is State.TAKING_OFF
        self._watch.due_from = self._watch_from
        until = min(self._phases.until, self._magnet.until, until)
        return self._guidance.look_ahead(stamps, until)

    @property
    def looked_ahead(self) -> int:
        """Number of the steps that `follow_scenario` has done since `look_ahead`."""
        return self._guidance.followed

    def watch(self) -> bool:
        """Step the executive of the grasps after a compiled step; return whether the steps that
        `look_ahead` has computed still are to come."""
        path = self._guidance.trajectory
        self.watch_payload()
        self._watch.due_from = self._watch_from
        return self.nominal and self._guidance.trajectory is path

    def resume(self, state: np.ndarray, authority: Authority) -> None:
        """Go on after compiled steps, the last one with state (3, 6 + n) and authority."""
        seen, self.output.time = self._in_flight, self._stamp - self._takeoff
        seen.on_ground, seen.authority = self._is_on_ground(state), authority

    @property
    def _watch_from(self) -> float:
        """Scenario time [s] from which on the executive of the grasps is due."""
        off = self._parameters.grasp_checks == "off" or self.output.state is not State.FLYING
        return math.inf if off else self._watch.executive.due_from
