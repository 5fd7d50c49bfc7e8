"""A pilot, a ground station or the autopilot's failsafe takes over in flight; seen on the wire.

Bridge, stand-in and ground station speak MAVLink over UDP (`wired_flight`). Every case begins in a
fork of the process that has flown up to that instant, and opens its own sockets.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
import pytest
from wired_flight import Steps, WiredAutopilot, wired_flight

from uam_control.coordinates import ATTITUDE, CHI
from uam_control.maths.rotations import matrix_from_euler
from uam_control.offboard.modes import Mode
from uam_control.supervision import OperatorCommand, State
from uam_lab.flights.direct.flight import DirectFlight

# phases of quick_pick, and the time [s] in the phase at which somebody takes over
TAKE_OFF, APPROACH, PICK, CARRY, LANDING = PHASES = "take-off", "approach", "pick", "carry", "land"
AT = {TAKE_OFF: 1.0, APPROACH: 2.0, PICK: 1.5, CARRY: 2.5, LANDING: 1.5}
GRASPED = 20.0  # [s] after which the magnet is on at the latest
SHORTLY = 0.3  # [s] of RETURN near home, where it descends at once
BACK_HOME = {TAKE_OFF: SHORTLY, APPROACH: 1.0, PICK: 1.0, CARRY: SHORTLY, LANDING: SHORTLY}
PUSHED = 0.12  # of the sticks, 1.2 m/s
LOW_BATTERY = {
    "COM_LOW_BAT_ACT": 2,
    "SIM_BAT_ENABLE": 1,
    "SIM_BAT_DRAIN": 1.0,
    "SIM_BAT_MIN_PCT": 6.0,
}


@dataclass
class Outcome:
    """What happened in a case.

    released_after [s]; requests: for mode or arming, on the wire while somebody else had control,
    and after that; steps: of body rates [rad/s] and thrust, from the return of control on; unlike:
    angle [deg] of the first desired attitude to the present one; tilt [deg]: the largest.
    """

    released_after: float = np.inf
    requests: list[str] = field(default_factory=list)
    requests_later: list[str] = field(default_factory=list)
    setpoints: int = 0
    resumed: bool = False
    answer: str = ""
    steps: tuple[float, float] = (0.0, 0.0)
    unlike: float = np.inf
    tilt: float = 0.0
    modes: tuple[Mode, ...] = ()
    held: State = State.GROUNDED
    phase: str = ""
    state: State = State.GROUNDED
    abort_reason: str = ""
    armed: bool = True


class Case:
    """One take-over of a flight; `pushed`: the pilot's stick, None without a radio."""

    def __init__(self, flight: DirectFlight) -> None:
        self.flight, self.outcome, self.pushed = flight, Outcome(), None
        self.autopilot: WiredAutopilot = flight.autopilot
        self.ground = self.autopilot.ground
        self.begin = flight.plant.time

    @property
    def state(self) -> State:
        return self.flight.mission.output.state

    def fly(self, seconds: float = np.inf, until: Callable[[], bool] = lambda: False) -> None:
        """Fly on, or until the motors have stopped."""
        end = self.flight.plant.time + seconds
        while self.flight.plant.time < end and not until():
            self.tick()
            if not self.flight.armed:
                return

    def tick(self) -> None:
        flight, outcome = self.flight, self.outcome
        if self.pushed is not None and flight.plant.tick % 10 == 0:
            self.ground.sticks(self.pushed)
        flight.tick()
        if self.state is State.RELEASED:
            outcome.released_after = min(outcome.released_after, flight.plant.time - self.begin)
        rotation = matrix_from_euler(flight.plant.truth().state[CHI, ATTITUDE])
        outcome.tilt = max(outcome.tilt, float(np.degrees(np.arccos(rotation[2, 2]))))
        mode = self.autopilot.autopilot.commander.mode
        outcome.modes = tuple(dict.fromkeys((*outcome.modes, mode)))

    def take_over(self, mode: Mode, seconds: float = 0.0) -> None:
        """The ground station chooses a mode."""
        self.ground.choose(mode)
        self.fly(seconds)

    def resume(self) -> None:
        """Give the command, and watch the first second of the laws."""
        flight, outcome = self.flight, self.outcome
        self.count()
        outcome.resumed, outcome.answer = flight.mission.request(OperatorCommand.RESUME)
        if outcome.resumed:
            self.watch()

    def watch(self) -> None:
        """Fly until the laws have flown for a second; take the steps."""
        flight, outcome = self.flight, self.outcome
        steps = Steps(self.autopilot.autopilot)
        signals, flying = flight.control.signals, 0
        while flying < 250 and flight.armed:
            self.tick()
            steps.tick()
            flying += signals.flying
            if flying == 1:
                attitudes = signals.attitude_reference[CHI], signals.state[CHI, ATTITUDE]
                desired, present = map(matrix_from_euler, attitudes)
                cosine = (np.trace(desired.T @ present) - 1.0) / 2.0
                outcome.unlike = float(np.degrees(np.arccos(min(1.0, cosine))))
        outcome.steps = steps.rates, steps.thrust

    def count(self) -> None:
        """Take the requests on the wire so far."""
        outcome, autopilot = self.outcome, self.autopilot
        outcome.requests += autopilot.requests()
        outcome.setpoints += autopilot.setpoints
        autopilot.transport.sent.clear()

    def end(self) -> Outcome:
        """Fly to the end of the flight."""
        flight, outcome = self.flight, self.outcome
        if not outcome.resumed:
            self.count()
        flight.run()
        outcome.requests_later = self.autopilot.requests()
        output = flight.mission.output
        outcome.phase, outcome.state = output.phase, output.state
        outcome.abort_reason, outcome.armed = output.abort_reason, flight.armed
        return outcome


def hold(case: Case) -> None:
    case.take_over(Mode.HOLD, 2.0)
    case.resume()


def fly_away(case: Case) -> None:
    """The pilot takes over in POSITION and flies at 1.2 m/s."""
    case.pushed = 0.0
    case.fly(0.1)
    case.begin = case.flight.plant.time
    case.take_over(Mode.POSITION, 1.0)
    case.pushed = PUSHED
    case.fly(1.5)


def position(case: Case) -> None:
    """Handed back at 1.2 m/s."""
    fly_away(case)
    case.resume()
    case.pushed = 0.0


def back_home(case: Case) -> None:
    """RETURN, handed back in motion."""
    case.take_over(Mode.RETURN, BACK_HOME[case.flight.mission.output.phase])
    case.resume()


def land(case: Case) -> None:
    case.take_over(Mode.LAND, np.inf)


def battery(case: Case) -> None:
    for name, value in LOW_BATTERY.items():
        case.ground.set_parameter(name, value)
    commander = case.autopilot.autopilot.commander
    case.fly(5.0, lambda: commander.mode is not Mode.OFFBOARD)
    case.begin = case.flight.plant.time
    case.fly()


def sticks(case: Case) -> None:
    """The pilot moves the sticks in OFFBOARD; back in motion."""
    case.ground.set_parameter("COM_RC_OVERRIDE", 3)
    case.pushed = 0.0
    case.fly(0.5)
    case.begin, case.pushed = case.flight.plant.time, 0.4
    case.fly(0.1)
    case.pushed = PUSHED
    case.fly(1.5)
    case.resume()
    case.pushed = 0.0


def twice(case: Case) -> None:
    """The mode is switched a second time while OFFBOARD is being requested."""
    case.take_over(Mode.HOLD, 1.0)
    case.flight.mission.request(OperatorCommand.RESUME)
    case.fly(0.1, lambda: bool(case.autopilot.requests()))
    case.autopilot.transport.sent.clear()  # those of the command
    case.take_over(Mode.LAND, 0.3)
    case.take_over(Mode.HOLD, 2.0)
    case.resume()


def own_switch(case: Case) -> None:
    """The pilot's own switch gives control back: the vehicle brakes and waits for the command."""
    fly_away(case)
    case.count()
    case.ground.choose(Mode.OFFBOARD)
    case.watch()
    case.pushed = 0.0
    case.fly(2.0)
    case.outcome.held = case.state
    case.outcome.resumed, case.outcome.answer = case.flight.mission.request(OperatorCommand.RESUME)


def grasp(case: Case) -> None:
    """In the tick of the grasp: the magnet stays on, the payload is carried after the command."""
    case.fly(GRASPED, lambda: case.flight.control.signals.magnet)
    assert case.flight.control.signals.magnet
    case.begin = case.flight.plant.time
    hold(case)


def stop_motors(case: Case) -> None:
    """The pilot stops the motors in the air."""
    case.ground.stop_motors()
    case.fly(3.0)


ALL = hold, position, back_home, land, battery
STAY = land, battery
HELD_OUT = sticks, twice, own_switch, grasp


def _fly(flight: DirectFlight, do: Callable[[Case], None], sender) -> None:
    flight.autopilot.connect()
    case = Case(flight)
    do(case)
    sender.send(case.end())


def outcomes(
    at: str, cases: Iterable[Callable[[Case], None]], after: float = 0.0, **changes: object
) -> dict[str, Outcome]:
    """Fly the nominal mission into the phase `at`, then each case in a fork.

    after [s]: time in the phase, 0 for that of AT; changes: of the vehicle.
    """
    flight, output = wired_flight(**changes), None
    while output is None or output.phase != at:
        flight.tick()
        output = flight.mission.output
        assert not output.done
    end = flight.plant.time + (after or AT[at])
    while flight.plant.time < end:
        flight.tick()
    assert output.phase == at
    forked, started = multiprocessing.get_context("fork"), {}
    for do in cases:
        receiver, sender = forked.Pipe(duplex=False)
        process = forked.Process(target=_fly, args=(flight, do, sender))
        process.start()
        sender.close()
        started[do.__name__] = process, receiver
    found = {}
    for name, (process, receiver) in started.items():
        found[name] = receiver.recv()
        process.join()
    return found


def assert_final(outcomes: dict[str, Outcome]) -> None:
    """The pilot's word is final, and control comes back without a step."""
    for by, outcome in outcomes.items():
        assert outcome.released_after < 0.1, by
        assert outcome.requests == [], by
        assert outcome.setpoints > 50, (by, "the stream goes on")
        assert outcome.tilt < 25.0, by
        if by in [case.__name__ for case in STAY]:
            assert outcome.modes[:1] in ((Mode.LAND,), (Mode.OFFBOARD,)), by
            assert Mode.OFFBOARD not in outcome.modes[1:] and outcome.requests_later == [], by
            assert outcome.state is State.DISARMED and not outcome.armed, by
            assert "has control" in outcome.abort_reason, by
            continue
        assert outcome.resumed, (by, outcome.answer)
        rates, thrust = outcome.steps
        assert rates < 0.25 and thrust < 0.05 and outcome.unlike < 1.0, (by, outcome)
        assert outcome.phase == "landed" and not outcome.abort_reason, by


@pytest.mark.slow
@pytest.mark.parametrize("at", PHASES)
def test_the_vehicle_is_released_at_once_and_comes_back_by_command_only(at):
    assert_final(outcomes(at, ALL))


def test_in_short_the_vehicle_is_released_and_comes_back_by_command_only():
    assert_final(outcomes(PICK, (position, land)))


@pytest.mark.slow
def test_held_out_take_overs():
    found = outcomes(PICK, HELD_OUT)
    assert_final(found)
    assert found["own_switch"].held is State.HOLDING
    assert Mode.LAND in found["twice"].modes


@pytest.mark.slow
def test_handed_back_above_the_payload_while_the_path_is_beside_its_place():
    """The path is shifted to a payload that stands 25 mm beside its place."""
    beside = {"variation.payload_offset": [0.0, 0.025]}
    assert_final(outcomes(PICK, (hold, position), **beside))


@pytest.mark.slow
def test_motors_stopped_in_the_air_are_not_started_again():
    (outcome,) = outcomes(TAKE_OFF, (stop_motors,)).values()
    assert outcome.requests == outcome.requests_later == [] and not outcome.armed
    assert outcome.state is State.DISARMED


@pytest.mark.slow
def test_a_mode_chosen_while_the_vehicle_arms_ends_the_flight_before_take_off():
    """At the first tick with motors: nothing is requested any more, nothing takes off."""
    flight = wired_flight()
    while not flight.armed:
        flight.tick()
    case = Case(flight)
    case.autopilot.transport.sent.clear()
    case.take_over(Mode.HOLD, 0.1)
    height = flight.plant.truth().state[CHI, 2]
    case.fly(15.0)
    assert case.autopilot.requests() == [] and not flight.armed
    assert flight.plant.truth().state[CHI, 2] < height + 0.02
