"""The offboard sequence while somebody else has control: release, regain, lost links, kill."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uam_control.offboard.exchange import Reported, Request
from uam_control.offboard.modes import MavResult, Mode
from uam_control.offboard.offboard_parameters import OffboardParameters
from uam_control.offboard.sequence import NEW_REPORTS, OffboardSequence, Phase

PERIOD = 0.004
OFFBOARD = Reported(True, True, Mode.OFFBOARD, Mode.OFFBOARD)
CHOSEN = Reported(True, True, Mode.HOLD, Mode.HOLD)  # by a person
FAILSAFE = Reported(True, True, Mode.LAND, Mode.OFFBOARD, failsafe=True)
OTHERS = sorted(set(Mode) - {Mode.OFFBOARD, Mode.UNKNOWN, Mode.TERMINATION}, key=str)
RETURNING = OffboardParameters(return_after_lost_link=True)


class Ticks:
    """A sequence in flight, tick by tick; `requests`: what it requested; `streamed`: in tick."""

    def __init__(self, parameters=None):
        self.sequence, self.requests, self.tick = OffboardSequence(parameters), [], 0
        self.sequence.set_desired(True)
        self.run(1.1, Reported(True, False, Mode.HOLD))
        self.run(0.1, Reported(True, False, Mode.OFFBOARD))
        self.run(0.5, OFFBOARD)
        assert self.sequence.phase is Phase.FLYING
        self.requests.clear()

    @property
    def time(self):
        return PERIOD * self.tick

    def run(self, seconds, seen, streams=True):
        """Tick with a constant report; streams: whether setpoints are sent. Return the requests."""
        before = len(self.requests)
        for _ in range(round(seconds / PERIOD)):
            if streams:
                self.sequence.streamed(self.time)
            request = self.sequence.update(self.time, seen)
            if request is not None:
                self.requests.append(request)
            self.tick += 1
        return self.requests[before:]


@pytest.mark.parametrize("mode", OTHERS)
@pytest.mark.parametrize("parameters", [None, RETURNING])
def test_a_mode_that_a_person_chose_is_released_in_the_same_tick_and_stays(mode, parameters):
    flight = Ticks(parameters)
    seen = Reported(True, True, mode, mode)
    assert flight.run(PERIOD, seen) == [] and flight.sequence.phase is Phase.RELEASED
    assert flight.run(60.0, seen) == [] and flight.sequence.phase is Phase.RELEASED
    assert flight.sequence.in_control == f"the pilot or a ground station, in {mode.name}"
    assert flight.sequence.streaming


def test_the_pilots_own_switch_gives_control_back():
    flight = Ticks()
    flight.run(1.0, CHOSEN)
    assert flight.run(1.0, OFFBOARD) == []
    assert flight.sequence.phase is Phase.FLYING and flight.sequence.in_control == "the companion"
    assert flight.sequence.reasons == ()


def test_regain_is_five_requests_half_a_second_apart_and_no_more():
    flight = Ticks()
    flight.sequence.regain(flight.time)  # nobody else has control: no effect
    assert flight.run(1.0, OFFBOARD) == []
    flight.run(1.0, CHOSEN)
    flight.sequence.regain(flight.time)
    first = flight.time
    assert flight.run(2.1, CHOSEN) == [Request.OFFBOARD] * 5
    assert flight.run(30.0, CHOSEN) == [] and flight.sequence.phase is Phase.RELEASED
    assert first + 2.0 < flight.time
    flight.sequence.regain(flight.time)
    assert flight.run(PERIOD, CHOSEN) == [Request.OFFBOARD]
    flight.run(1.0, OFFBOARD)
    assert flight.sequence.phase is Phase.FLYING
    assert flight.run(5.0, CHOSEN) == []  # requests that are left over do not count


def test_a_failsafe_is_named_as_such_and_a_later_choice_too():
    flight = Ticks()
    flight.run(0.1, FAILSAFE)
    assert flight.sequence.released_to == "the autopilot's failsafe, in LAND"
    flight.run(0.1, CHOSEN)
    assert flight.sequence.released_to == "the pilot or a ground station, in HOLD"
    flight = Ticks()  # an autopilot without CURRENT_MODE
    flight.run(0.1, FAILSAFE._replace(intended=Mode.UNKNOWN))
    assert flight.sequence.released_to == "the autopilot's failsafe, in LAND"


@pytest.mark.parametrize(
    ("parameters", "lost", "seen", "returns"),
    [
        (RETURNING, 1.0, FAILSAFE, 6),
        (RETURNING, 0.4, FAILSAFE, 0),  # the stream was not lost: LINK_GAP is 0.45 s
        (RETURNING, 1.0, FAILSAFE._replace(failsafe=False), 0),
        (RETURNING, 1.0, FAILSAFE._replace(intended=Mode.LAND), 0),
        (RETURNING, 1.0, FAILSAFE._replace(intended=Mode.UNKNOWN), 0),
        (OffboardParameters(), 1.0, FAILSAFE, 0),
        (OffboardParameters(return_after_lost_link=True, recovery_attempts=2), 1.0, FAILSAFE, 2),
    ],
)
def test_return_after_lost_link_needs_all_of_its_conditions(parameters, lost, seen, returns):
    flight = Ticks(parameters)
    flight.run(lost, OFFBOARD, streams=False)
    assert flight.run(30.0, seen) == [Request.OFFBOARD] * returns
    assert flight.sequence.phase is Phase.RELEASED


def test_a_lost_stream_long_ago_is_no_reason_to_return():
    flight = Ticks(RETURNING)
    flight.run(1.0, OFFBOARD, streams=False)
    flight.run(5.1, OFFBOARD)
    assert flight.run(30.0, FAILSAFE) == []


def test_the_wait_before_the_stream_is_no_lost_stream():
    """A battery failsafe just after the take-off stays."""
    flight = Ticks(RETURNING)
    assert flight.time < 5.0
    assert flight.run(30.0, FAILSAFE) == []


def test_a_setpoint_that_did_not_arrive_is_a_lost_stream():
    flight = Ticks(RETURNING)
    cut = flight.time
    flight.run(1.0, OFFBOARD._replace(delivered=cut))
    assert flight.run(0.1, FAILSAFE._replace(delivered=flight.time)) == []  # retry_interval
    assert flight.run(0.6, FAILSAFE) == [Request.OFFBOARD]


def test_a_short_success_does_not_refill_the_returns():
    flight = Ticks(RETURNING)
    asked = []
    for _ in range(20):
        flight.run(1.0, OFFBOARD, streams=False)
        asked += flight.run(1.0, FAILSAFE)
    assert asked == [Request.OFFBOARD] * 6


def test_a_person_who_chooses_a_mode_ends_the_return_for_good():
    flight = Ticks(RETURNING)
    flight.run(1.0, OFFBOARD, streams=False)
    assert flight.run(0.6, FAILSAFE) == [Request.OFFBOARD]
    assert flight.run(2.0, CHOSEN) == []
    assert flight.run(10.0, FAILSAFE) == []


def test_an_older_report_just_after_the_switch_is_no_release():
    """PX4 sends a heartbeat once a second: one of before the switch may come after the answer."""
    sequence = OffboardSequence()
    sequence.set_desired(True)
    before = Reported(True, False, Mode.HOLD)
    for tick in range(500):
        late = tick < 260 or 270 <= tick < 300  # OFFBOARD from 1.04 s on, SETTLING is 0.3 s
        seen = before if late else Reported(True, tick >= 350, Mode.OFFBOARD)
        sequence.update(PERIOD * tick, seen)
        assert sequence.phase is not Phase.FAILED
    assert sequence.phase is Phase.FLYING


def test_a_mode_chosen_before_arming_ends_the_start():
    sequence = OffboardSequence()
    sequence.set_desired(True)
    requests = []
    for tick in range(2000):
        mode = Mode.OFFBOARD if 260 <= tick < 400 else Mode.HOLD
        request = sequence.update(PERIOD * tick, Reported(True, False, mode))
        requests.append((tick, request))
    assert sequence.phase is Phase.FAILED
    assert "HOLD was chosen before arming: start again" in sequence.reasons[-1]
    assert not [request for tick, request in requests if request is not None and tick >= 400]


def test_a_vehicle_that_somebody_else_armed_is_left_alone():
    sequence = OffboardSequence()
    theirs = Reported(True, True, Mode.POSITION, Mode.POSITION)
    assert [sequence.update(PERIOD * k, theirs) for k in range(2000)] == [None] * 2000
    sequence.set_desired(True)
    assert [sequence.update(8.0 + PERIOD * k, theirs) for k in range(2000)] == [None] * 2000
    assert sequence.phase is Phase.RELEASED
    sequence.set_desired(False)
    assert [sequence.update(16.0 + PERIOD * k, theirs) for k in range(2000)] == [None] * 2000


def test_a_released_vehicle_is_not_disarmed_by_the_end_of_the_mission():
    flight = Ticks()
    flight.run(1.0, CHOSEN)
    flight.sequence.set_desired(False)
    assert flight.run(30.0, CHOSEN) == []
    flight.run(PERIOD, CHOSEN._replace(armed=False))
    assert flight.sequence.phase is Phase.DISARMED and flight.sequence.in_control == "nobody"


def test_a_vehicle_that_the_pilot_has_landed_is_not_armed_again():
    flight = Ticks()
    flight.run(1.0, CHOSEN)
    landed = CHOSEN._replace(armed=False)
    assert flight.run(30.0, landed) == [] and flight.sequence.phase is Phase.FAILED
    assert flight.run(30.0, landed._replace(mode=Mode.OFFBOARD)) == []


@pytest.mark.parametrize("seen", [OFFBOARD, CHOSEN, FAILSAFE])
def test_kill_repeats_until_disarmed_and_nothing_is_armed_after_it(seen):
    flight = Ticks()
    flight.run(0.1, seen)
    flight.sequence.kill()
    assert flight.run(10.0, seen) == [Request.KILL] * 20  # every retry_interval of 0.5 s
    assert OffboardSequence().commands[Request.KILL][1] == (0.0, 21196.0)
    flight.sequence.answer(Request.KILL, MavResult.ACCEPTED)
    silent = seen._replace(connected=False)
    assert flight.run(1.0, silent) == [Request.KILL] * 2  # behind a lost link too
    assert flight.run(30.0, seen._replace(armed=False)) == []
    assert flight.sequence.phase is Phase.FAILED
    flight.sequence.set_desired(False)
    assert flight.run(30.0, CHOSEN) == []  # armed by a person since: it is their vehicle


def test_kill_reaches_a_vehicle_that_is_arming():
    sequence = OffboardSequence()
    sequence.set_desired(True)
    for tick in range(300):
        mode = Mode.OFFBOARD if tick > 260 else Mode.HOLD
        sequence.update(PERIOD * tick, Reported(True, False, mode))
    assert sequence.phase is Phase.ARMING
    sequence.kill()
    assert sequence.update(1.2, Reported(True, False, Mode.OFFBOARD)) is Request.KILL
    assert sequence.update(1.204, OFFBOARD) is None
    assert sequence.update(1.7, OFFBOARD) is Request.KILL


def test_a_mode_chosen_after_regain_ends_its_requests():
    """The operator commands, OFFBOARD is refused, the pilot moves the mode switch."""
    for seen in (FAILSAFE, CHOSEN):
        flight = Ticks()
        flight.run(1.0, seen)
        flight.sequence.regain(flight.time)
        assert flight.run(0.1, seen) == [Request.OFFBOARD]
        other = Reported(True, True, Mode.POSITION, Mode.POSITION)
        assert flight.run(30.0, other) == [] and flight.sequence.phase is Phase.RELEASED


def test_a_mode_chosen_since_the_command_is_not_overruled():
    """The command reaches the sequence two ticks after it was given; the pilot was faster."""
    flight = Ticks()
    flight.run(1.0, CHOSEN)
    commanded = flight.time
    other = Reported(True, True, Mode.LAND, Mode.LAND)
    flight.run(2 * PERIOD, other)
    flight.sequence.regain(commanded)
    assert flight.run(30.0, other) == [] and flight.sequence.phase is Phase.RELEASED


def test_a_second_switch_of_the_pilot_counts_at_once():
    flight = Ticks()
    flight.run(1.0, CHOSEN)
    flight.run(0.1, OFFBOARD)
    assert flight.sequence.phase is Phase.FLYING
    flight.run(PERIOD, CHOSEN)
    assert flight.sequence.phase is Phase.RELEASED


def test_after_a_failsafe_of_the_mission_a_person_is_noticed_and_never_disarmed():
    flight = Ticks()
    flight.sequence.let_go = True
    flight.run(1.0, FAILSAFE)
    assert flight.sequence.phase is Phase.FLYING  # the failsafe that was asked for
    flight.run(PERIOD, CHOSEN)
    assert flight.sequence.in_control == "the pilot or a ground station, in HOLD"
    flight.sequence.set_desired(False)
    assert flight.run(30.0, CHOSEN) == []


def test_after_a_release_that_ended_with_disarming_the_next_flight_can_start():
    flight = Ticks()
    flight.run(1.0, CHOSEN)
    flight.run(1.0, CHOSEN._replace(armed=False))
    flight.sequence.set_desired(False)
    flight.run(1.0, CHOSEN._replace(armed=False))
    assert flight.sequence.released_to == "" and flight.sequence.in_control == "nobody"
    flight.sequence.set_desired(True)
    asked = flight.run(3.0, CHOSEN._replace(armed=False))
    assert asked and set(asked) == {Request.OFFBOARD}


KILLED = OFFBOARD._replace(killed=True)
TERMINATED = Reported(True, True, Mode.TERMINATION, Mode.TERMINATION, killed=True)


@pytest.mark.parametrize("how", ["text", "heartbeat", "termination"])
@pytest.mark.parametrize("before", [OFFBOARD, CHOSEN])
def test_a_kill_by_the_autopilot_is_final(how, before):
    """Disarming is requested, after 5 s by force, until it has happened; nothing is armed then."""
    flight = Ticks()
    flight.run(1.0, before)
    if how == "text":
        flight.sequence.text(6, "Kill engaged\t")  # PX4: of severity INFO on the ground
    else:
        flight.run(PERIOD, KILLED if how == "heartbeat" else TERMINATED)
    assert flight.sequence.stopped and flight.sequence.phase is Phase.FAILED
    expected = "flight termination" if how == "termination" else "the pilot's kill switch"
    assert flight.sequence.failure == f"{expected} has stopped the motors"
    flight.requests.clear()
    again = TERMINATED if how == "termination" else OFFBOARD  # the switch is off again
    requests = flight.run(4.4, again)
    assert len(requests) >= 8 and set(requests) == {Request.DISARM}
    assert OffboardSequence().commands[Request.DISARM][1] == (0.0, 0.0)
    flight.sequence.set_desired(False)
    flight.run(1.0, again)
    assert flight.run(1.0, again) == [Request.KILL] * 2  # lies where PX4 does not see it landed
    assert flight.sequence.stopped
    assert flight.run(5.0, again._replace(armed=False)) == [] and flight.sequence.stopped
    assert flight.sequence.phase is Phase.DISARMED
    flight.sequence.set_desired(True)
    assert not flight.sequence.stopped and not flight.sequence.failure


def test_a_kill_switch_that_is_tried_before_a_flight_ends_nothing():
    sequence = OffboardSequence()
    for tick in range(500):
        sequence.update(PERIOD * tick, Reported(True, False, Mode.HOLD, killed=tick > 100))
        sequence.text(6, "Kill engaged")
    assert not sequence.stopped and sequence.phase is Phase.STREAMING


def test_a_pilot_who_flies_on_after_a_kill_is_left_alone():
    flight = Ticks()
    flight.run(0.1, KILLED)
    flight.requests.clear()
    assert flight.run(10.0, CHOSEN) == [] and flight.sequence.phase is Phase.RELEASED
    flight.sequence.set_desired(False)
    assert flight.run(10.0, CHOSEN) == [] and flight.sequence.stopped


def test_a_failed_sequence_is_released_to_who_takes_over_and_disarmed_after_the_landing():
    flight = Ticks()
    flight.sequence.rebooted(flight.time)
    assert flight.sequence.failure == "the autopilot rebooted in flight"
    assert flight.run(1.0, OFFBOARD) == [] and flight.sequence.phase is Phase.FAILED
    landing = Reported(True, True, Mode.LAND, Mode.LAND)
    flight.run(PERIOD, landing)
    assert flight.sequence.phase is Phase.RELEASED and not flight.sequence.failure
    flight = Ticks()
    flight.sequence.rebooted(flight.time)
    flight.sequence.set_desired(False)
    assert set(flight.run(1.0, OFFBOARD)) == {Request.DISARM}


def test_a_landing_by_a_person_stays_one_when_px4_goes_back_to_offboard_to_disarm():
    flight = Ticks()
    landing = Reported(True, True, Mode.LAND, Mode.LAND)
    flight.run(1.0, landing)
    flight.run(0.5, landing._replace(intended=Mode.OFFBOARD))
    assert flight.sequence.released_to == "the pilot or a ground station, in LAND"
    flight.run(PERIOD, landing._replace(armed=False, intended=Mode.OFFBOARD))
    assert flight.sequence.failure.endswith("the pilot or a ground station, in LAND")


def test_after_a_frozen_bridge_the_vehicle_is_the_autopilots_until_its_reports_are_new():
    flight = Ticks()
    sequence = flight.sequence
    sequence.begin(flight.time, 1.0)
    assert not sequence.released
    for _ in range(10):  # ticks that have waited
        sequence.begin(flight.time, 1.0, late=0.5)
        assert sequence.withheld and not sequence.released
        flight.run(PERIOD, OFFBOARD, streams=False)
    flight.tick += 1250
    sequence.begin(flight.time, 1.0)
    assert sequence.released and sequence.withheld and sequence.after_loss
    assert sequence.released_to == "the autopilot's failsafe after a lost stream of setpoints"
    ended = flight.time + NEW_REPORTS
    while flight.time < ended - PERIOD:
        sequence.begin(flight.time, 1.0)
        assert sequence.withheld
        flight.run(PERIOD, OFFBOARD, streams=False)  # an old report
        assert sequence.released
    for _ in range(3):
        sequence.begin(flight.time, 1.0)
        flight.run(PERIOD, FAILSAFE)
    assert not sequence.withheld and sequence.after_loss
    flight.run(PERIOD, OFFBOARD)
    assert sequence.phase is Phase.FLYING and not sequence.after_loss


@pytest.mark.parametrize("late", [1.05, 2.0])
def test_a_late_tick_knows_that_the_stream_was_lost(late):
    """Stamps of 0.2 s after the last setpoint; the autopilot's report is newer, by `late`."""
    flight = Ticks()
    flight.tick += 50
    flight.sequence.begin(flight.time, 1.0, late)
    flight.run(PERIOD, FAILSAFE, streams=False)
    assert flight.sequence.after_loss
    holder = "the autopilot's failsafe after a lost stream of setpoints"
    assert flight.sequence.released_to.startswith(holder)


def test_a_gap_within_the_loss_time_or_on_purpose_is_none():
    flight = Ticks()
    flight.tick += 240
    flight.sequence.begin(flight.time, 1.0)
    assert flight.sequence.phase is Phase.FLYING
    flight.sequence.let_go = True
    flight.tick += 1000
    flight.sequence.begin(flight.time, 1.0)
    assert flight.sequence.phase is Phase.FLYING


REPORTS = st.builds(
    Reported,
    connected=st.sampled_from([True, True, True, False]),
    armed=st.booleans(),
    mode=st.sampled_from([Mode.OFFBOARD, Mode.OFFBOARD, *Mode]),
    intended=st.sampled_from(Mode),
    failsafe=st.booleans(),
    killed=st.sampled_from([False, False, False, True]),
)
EVENTS = st.tuples(
    st.sampled_from([0.004, 0.1, 0.6, 3.0]),
    REPORTS,
    st.sampled_from(["", "", "", "regain", "reboot", "disarm", "arm", "kill", "let go"]),
    st.booleans(),
)


def happen(flight, event):
    sequence = flight.sequence
    actions = {
        "regain": lambda: sequence.regain(flight.time),
        "reboot": lambda: sequence.rebooted(flight.time),
        "disarm": lambda: sequence.set_desired(False),
        "arm": lambda: sequence.set_desired(True),
        "kill": sequence.kill,
        "let go": lambda: setattr(sequence, "let_go", True),
        "": lambda: None,
    }
    actions[event]()


@given(st.lists(EVENTS, max_size=30), st.booleans())
def test_no_request_for_offboard_follows_a_chosen_mode_in_any_interleaving(events, returning):
    """Once released to a person, only regain, a new start on the ground or OFFBOARD end it."""
    flight = Ticks(RETURNING if returning else None)
    sequence = flight.sequence
    budget = None  # requests for OFFBOARD that are allowed; None: nobody else has control
    for seconds, seen, event, streams in events:
        happen(flight, event)
        if event == "regain" and budget is not None:
            budget = 5
        if event == "arm" and sequence.phase is Phase.STREAMING and not seen.armed:
            budget = None  # a new flight
        chosen = seen.intended not in (Mode.OFFBOARD, Mode.UNKNOWN)
        for _ in range(round(seconds / PERIOD)):
            requests = flight.run(PERIOD, seen, streams)
            if sequence.phase is not Phase.RELEASED:
                budget = None
            elif chosen and budget is None:
                budget = 0
            if sequence.phase is Phase.RELEASED and budget is not None:
                budget -= requests.count(Request.OFFBOARD)
                assert budget >= 0
        assert returning or sequence._returns == 0
        assert sequence._returns <= 6


@given(st.lists(EVENTS, max_size=30))
def test_arming_is_requested_in_offboard_only_and_never_in_a_flight(events):
    flight = Ticks(RETURNING)
    sequence, before = flight.sequence, Phase.FLYING
    for seconds, seen, event, streams in events:
        happen(flight, event)
        for _ in range(round(seconds / PERIOD)):
            before = sequence.phase
            for request in flight.run(PERIOD, seen, streams):
                if request is Request.ARM:
                    assert seen.mode is Mode.OFFBOARD and not seen.armed and sequence._desired
                    assert before not in (Phase.FLYING, Phase.RELEASED, Phase.FAILED)
                if request is Request.DISARM:
                    given_back = before is Phase.RELEASED and seen.mode is Mode.OFFBOARD
                    ours = before not in (Phase.RELEASED, Phase.STREAMING, Phase.FAILED)
                    assert ours or given_back or sequence.stopped


@pytest.mark.parametrize("mode", OTHERS)
def test_a_pilot_who_takes_off_again_after_the_landing_is_not_disarmed(mode):
    flight = Ticks()
    flight.sequence.set_desired(False)
    assert flight.run(0.1, OFFBOARD) == [Request.DISARM]  # refused: not landed yet
    seen = Reported(True, True, mode, mode)
    assert flight.run(60.0, seen) == [] and flight.sequence.phase is Phase.RELEASED
    assert "has control" in flight.sequence.reasons[-1]
    assert set(flight.run(1.0, OFFBOARD)) == {Request.DISARM}  # given back after the mission
    flight.run(0.1, Reported(True, False, Mode.HOLD))
    assert flight.sequence.phase is Phase.DISARMED and flight.sequence.in_control == "nobody"


def test_the_motors_of_the_autopilots_own_failsafe_are_stopped_after_it():
    flight = Ticks()
    flight.sequence.let_go = True
    flight.run(1.0, FAILSAFE)
    flight.sequence.set_desired(False)
    assert Request.DISARM in flight.run(1.0, FAILSAFE)
