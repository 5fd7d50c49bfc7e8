"""The pilot, a ground station or the autopilot's failsafe takes over in flight (direct engine).

Every case begins in a fork of the process that has flown up to that instant.
"""

from __future__ import annotations

import multiprocessing
from dataclasses import dataclass

import numpy as np
import pytest

from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_control.supervision import OperatorCommand, State
from uam_lab.flight.direct.flight import DirectFlight
from uam_sim_bridge.autopilot.autopilot_estimator import ATTITUDE
from uam_sim_bridge.mavlink.protocol.modes import MavCmd, MavResult, Mode
from uam_sim_bridge.plant import Vehicle

TAKE_OFF, APPROACH, PICK, CARRY, LANDING = 1.0, 20.0, 34.0, 50.0, 83.5  # [s] mission time
BATTERY = "battery"
BACK_IN_OFFBOARD = (Mode.POSITION, Mode.HOLD, Mode.RETURN)
STAYS = (Mode.LAND, BATTERY)
HELD = 6.0  # [s] for which somebody else has control
# [s] of it in RETURN, then HOLD: RETURN descends as soon as it is at home
RETURNING = {TAKE_OFF: 0.1, APPROACH: 2.0, PICK: 1.9, CARRY: 0.5, LANDING: 0.3}
WATCHED = 2.0  # [s] after control is back
FORWARD = (0.12, 0.0, 0.0, 0.0)  # sticks, 1.2 m/s
CENTRED = (0.0, 0.0, 0.0, 0.0)
LOW_BATTERY = {
    "COM_LOW_BAT_ACT": 2,
    "SIM_BAT_ENABLE": 1,
    "SIM_BAT_DRAIN": 1.0,
    "SIM_BAT_MIN_PCT": 6.0,
}


@dataclass
class Outcome:
    """What happened in a case.

    released_after [s]; offboard_requests: while somebody else had control; tilt [deg], thrust_step,
    rate_step [rad/s]: the largest, the steps after control was back; modes: of the autopilot since
    the take-over.
    """

    released_after: float = np.inf
    resumed: bool = False
    answer: str = ""
    offboard_requests: int = 0
    tilt: float = 0.0
    thrust_step: float = 0.0
    rate_step: float = 0.0
    modes: tuple[Mode, ...] = ()
    phase: str = ""
    state: State = State.GROUNDED
    abort_reason: str = ""
    armed: bool = True


class Case:
    """One take-over of a flight."""

    def __init__(self, flight: DirectFlight) -> None:
        self.flight, self.autopilot = flight, flight.autopilot.autopilot
        self.outcome = Outcome()
        self._command, self.autopilot.command = self.autopilot.command, self._count

    def _count(self, time, command, parameters):
        self.outcome.offboard_requests += command == MavCmd.DO_SET_MODE
        return self._command(time, command, parameters)

    def take_over(self, by: Mode | str) -> None:
        flight, autopilot = self.flight, self.autopilot
        if by is BATTERY:
            for name, value in LOW_BATTERY.items():
                autopilot.set_parameter(name, value)
            while autopilot.commander.mode is Mode.OFFBOARD:
                flight.tick()
            return
        if by is Mode.POSITION:
            autopilot.manual(flight.plant.time, CENTRED)
        self.choose(by)

    def choose(self, mode: Mode) -> None:
        commander, time = self.autopilot.commander, self.flight.plant.time
        assert commander.request_mode(time, mode, aided=True) is MavResult.ACCEPTED

    def held(self, by: Mode | str, at: float) -> None:
        """Fly without control, or until the motors stop."""
        flight, outcome, begin = self.flight, self.outcome, self.flight.plant.time
        stops = begin + RETURNING[at] if by is Mode.RETURN else np.inf
        while flight.armed and (by in STAYS or flight.plant.time < begin + HELD):
            if flight.plant.time >= stops:
                self.choose(Mode.HOLD)
                stops = np.inf
            if by is Mode.POSITION:
                pushed = 1.0 < flight.plant.time - begin < 2.0
                self.autopilot.manual(flight.plant.time, FORWARD if pushed else CENTRED)
            self.tick()
            if flight.mission.output.state is State.RELEASED:
                outcome.released_after = min(outcome.released_after, flight.plant.time - begin)

    def resume(self) -> None:
        flight, outcome = self.flight, self.outcome
        outcome.resumed, outcome.answer = flight.mission.request(OperatorCommand.RESUME)
        if not outcome.resumed:
            return
        requests, begin = outcome.offboard_requests, flight.plant.time
        before = self.autopilot._setpoint.copy()
        while flight.plant.time < begin + WATCHED:
            self.tick()
            now = self.autopilot._setpoint.copy()
            steps = np.abs(now - before)
            outcome.thrust_step = max(outcome.thrust_step, float(steps[3]))
            outcome.rate_step = max(outcome.rate_step, float(np.max(steps[:3])))
            before = now
        outcome.offboard_requests = requests  # those of the command do not count

    def tick(self) -> None:
        self.flight.tick()
        outcome, (_, x, y, _) = self.outcome, self.autopilot.estimator.estimate[ATTITUDE]
        outcome.tilt = max(outcome.tilt, float(np.degrees(np.arccos(1.0 - 2.0 * (x**2 + y**2)))))
        outcome.modes = tuple(dict.fromkeys((*outcome.modes, self.autopilot.commander.mode)))


def fly_case(flight: DirectFlight, by: Mode | str, at: float, sender) -> None:
    case = Case(flight)
    case.take_over(by)
    case.held(by, at)
    if by in BACK_IN_OFFBOARD:
        case.resume()
    flight.run()
    output, outcome = flight.mission.output, case.outcome
    outcome.phase, outcome.state = output.phase, output.state
    outcome.abort_reason, outcome.armed = output.abort_reason, flight.armed
    sender.send(outcome)


def outcomes(at: float) -> dict[Mode | str, Outcome]:
    """Fly the nominal mission up to `at` [s], then each case in a fork."""
    flight = DirectFlight(
        load_scenario("pick_and_place"), load_profile("s500"), Vehicle.load(), 0.2, 1
    )
    while flight.mission.output.time < at:
        flight.tick()
    forked, cases = multiprocessing.get_context("fork"), {}
    for by in (*BACK_IN_OFFBOARD, *STAYS):
        receiver, sender = forked.Pipe(duplex=False)
        process = forked.Process(target=fly_case, args=(flight, by, at, sender))
        process.start()
        sender.close()
        cases[by] = process, receiver
    found = {}
    for by, (process, receiver) in cases.items():
        found[by] = receiver.recv()
        process.join()
    return found


@pytest.mark.parametrize(
    "at",
    [
        pytest.param(TAKE_OFF, marks=pytest.mark.slow),
        pytest.param(APPROACH, marks=pytest.mark.slow),
        PICK,
        pytest.param(CARRY, marks=pytest.mark.slow),
        pytest.param(LANDING, marks=pytest.mark.slow),
    ],
)
def test_the_vehicle_is_released_at_once_and_comes_back_by_command_only(at):
    for by, outcome in outcomes(at).items():
        assert outcome.released_after < 0.1, by
        assert outcome.offboard_requests == 0, by
        assert outcome.tilt < 20.0, by
        assert outcome.state is State.DISARMED, by
        if by in STAYS:
            assert outcome.modes[:1] == (Mode.LAND,) and Mode.OFFBOARD not in outcome.modes, by
            assert "has control" in outcome.abort_reason and not outcome.armed, by
        else:
            assert outcome.resumed, (by, outcome.answer)
            assert outcome.thrust_step < 0.1 and outcome.rate_step < 0.5, by
            assert outcome.phase == "landed" and not outcome.abort_reason, by
