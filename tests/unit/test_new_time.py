"""Stamps that go back belong to a new simulation: everything begins anew."""

from __future__ import annotations

import numpy as np
from settled_join import SettledJoin

from uam_control.mission import Mission, MissionParameters, StartParameters, load_scenario
from uam_control.offboard.modes import Mode
from uam_control.offboard.sequence import Phase
from uam_control.stages.autopilot_port import AutopilotReport
from uam_control.stages.mission_stage import MissionStage
from uam_control.stages.tick_stamps import Timing
from uam_control.stamps import NEW_TIME, SECOND
from uam_control.supervision import State
from uam_control.vehicle import derived_parameters, load_description


def test_a_join_begins_anew_with_the_stamps_of_a_new_simulation():
    fired = []
    join = SettledJoin(["a", "b"], lambda stamp, a, b: fired.append((stamp, a, b)))
    for stamp in (20 * SECOND, 4_000_000, 8_000_000):
        join.add("a", stamp, 1)
        join.add("b", stamp, 2)
    assert [stamp for stamp, _, _ in fired] == [20 * SECOND, 4_000_000, 8_000_000]
    assert join.dropped == 0
    join.add("a", 4_000_000, 3)  # late, not a new simulation
    assert join.dropped == 1 and len(fired) == 3
    assert NEW_TIME > 100 * 4_000_000  # many ticks


def test_a_mission_in_flight_begins_anew_on_the_ground():
    parameters = MissionParameters.from_mapping(
        derived_parameters(load_description())["mission"], 2
    )
    mission = Mission(load_scenario("hover"), parameters, StartParameters(auto_start=False))
    stage = MissionStage(mission, Timing())
    state = np.zeros((3, 8))
    state[0, 2], state[0, 6:] = 0.28, mission.scenario.arm_start

    def tick(stamp, armed_since=None):
        stage.inputs.inputs.mocap(stamp / SECOND, state[0, :3], np.array([1.0, 0.0, 0.0, 0.0]))
        stage.inputs.inputs.joints(stamp / SECOND, np.zeros(2))
        for subsystem in ("position", "attitude", "arm"):
            stage.inputs.inputs.gains(stamp / SECOND, subsystem, ["K0"], np.zeros(1))
        armed = armed_since is not None
        report = AutopilotReport(
            True, Mode.OFFBOARD, armed, Phase.FLYING, (), armed_since=armed_since
        )
        stage.autopilot(stamp, report)
        stage.begin(stamp, state)
        stage.advance(stamp, state)
        state[:2] = np.where(mission.output.flying, mission.output.reference[:2], state[:2])

    begin, period = 50 * SECOND, 4_000_000
    for k in range(3):
        tick(begin + k * period)
    assert mission.start() == (True, "arming")
    for k in range(3, 600):
        tick(begin + k * period, begin + 3 * period)
    assert mission.output.state is State.FLYING
    state[:] = 0.0
    state[0, 2], state[0, 6:] = 0.28, mission.scenario.arm_start
    tick(period)
    assert mission.output.state is State.GROUNDED and not mission.output.arm
    assert not mission.output.flying and not mission.output.done
    for k in range(2, 5):
        tick(k * period)
    assert mission.start() == (True, "arming")
