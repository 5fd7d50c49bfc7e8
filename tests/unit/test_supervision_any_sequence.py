"""Properties of the supervisor for any sequence of inputs."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule
from supervised import S500, observation

from uam_control.supervision import (
    Authority,
    Event,
    Guide,
    OperatorCommand,
    Readings,
    State,
    Supervisor,
)
from uam_control.supervision.states import TARGETS

NUMBERS = st.floats(-1e3, 1e3) | st.sampled_from([math.nan, math.inf, -math.inf, 0.0])
READINGS = st.builds(
    Readings,
    joint_effort=st.builds(np.array, st.tuples(NUMBERS, NUMBERS)),
    gains=st.builds(np.array, st.tuples(NUMBERS, NUMBERS, NUMBERS)),
    **dict.fromkeys(
        (
            "battery", "mocap_age", "joint_age", "controller_age", "missed_ticks", "temperature",
            "autopilot_age", "mocap_still", "contradiction", "round_trip", "loop_delay",
        ),
        NUMBERS,
    ),
    mocap_position=st.builds(np.array, st.tuples(NUMBERS, NUMBERS, NUMBERS)),
)  # fmt: skip


class AnySequence(RuleBasedStateMachine):
    """The supervisor's properties hold for any sequence of inputs."""

    # while somebody else has control
    WITHOUT_CONTROL = (State.GROUNDED, State.RELEASED, State.FAILSAFE, State.DISARMED)

    def __init__(self):
        super().__init__()
        self.supervisor = Supervisor(S500)
        self.seen = observation(ready=False)
        self.stamp = 0.0
        self.decision = self.supervisor.decision
        self.before = State.GROUNDED

    def step(self, stamp, command=None):
        self.before = self.supervisor.state
        armed, changes = self.decision.arm, len(self.supervisor.changes)
        self.decision = self.supervisor.step(stamp, self.seen, command)
        assert armed or not self.decision.arm  # never arms by itself
        if self.seen.authority.released_to:
            assert self.decision.state in self.WITHOUT_CONTROL
        if self.before is State.FAILSAFE and self.decision.state is not State.FAILSAFE:
            # by command, on the ground, or held again while nobody else flies
            assert self.decision.state in (State.DISARMED, State.HOLDING, State.LANDING)
        new = self.supervisor.changes[changes:]
        assert len(new) <= 1
        for change in new:
            assert TARGETS[change.source, change.event] is change.target
            assert change.source is not State.DISARMED and change.cause
            assert not math.isnan(change.stamp)
            if change.target is State.DISARMED:
                seen = self.seen
                on_ground = seen.on_ground or seen.touchdown or seen.authority.landed
                # before take-off the vehicle stands, whatever the observation says
                given_up = change.event is Event.GIVEN_UP
                by_command = command is OperatorCommand.DISARM
                assert on_ground or not seen.armed or by_command or given_up

    @rule(seconds=st.sampled_from([0.004, 0.05, 0.6, 2.0]), ticks=st.integers(1, 20))
    def time_passes(self, seconds, ticks):
        for _ in range(ticks):
            self.stamp += seconds
            self.step(self.stamp)

    @rule(stamp=NUMBERS)
    def a_strange_stamp(self, stamp):
        self.step(stamp)
        if math.isfinite(stamp):
            self.stamp = max(self.stamp, stamp)

    @rule()
    def the_start(self):
        self.supervisor.start()
        self.decision = self.supervisor.decision

    @rule(who=st.sampled_from(["", "", "the pilot, in HOLD"]), landed=st.booleans())
    def control(self, who, landed):
        self.seen.authority = Authority(who, landed)

    @rule(command=st.sampled_from(OperatorCommand))
    def a_command(self, command):
        self.stamp += 0.004
        refusal = self.supervisor.refusal(command, self.seen)
        self.step(self.stamp, command)
        assert isinstance(refusal, str) and "\n" not in refusal

    @rule(row=st.integers(0, 2), column=st.integers(0, 7), value=NUMBERS)
    def an_estimate(self, row, column, value):
        self.seen.state[row, column] = value

    @rule()
    def all_well(self):
        self.seen = observation(readings=Readings())

    @rule(readings=READINGS)
    def other_readings(self, readings):
        self.seen.readings = readings

    @rule(
        name=st.sampled_from(
            ["armed", "ready", "landing_due", "on_ground", "touchdown", "overdue"]
        ),
        on=st.booleans(),
    )
    def the_mission_says(self, name, on):
        setattr(self.seen, name, on)

    @invariant()
    def what_the_state_means(self):
        decision = self.decision
        idle = (State.GROUNDED, State.RELEASED, State.FAILSAFE, State.DISARMED)
        assert (decision.guide is Guide.NOTHING) is (decision.state in idle)
        assert decision.arm or decision.state in (State.GROUNDED, State.DISARMED, State.FAILSAFE)
        assert decision.state is not State.DISARMED or not (decision.arm or decision.keep_magnet)


TestAnySequence = AnySequence.TestCase
TestAnySequence.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
