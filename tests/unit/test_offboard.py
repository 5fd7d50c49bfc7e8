"""The offboard sequence against a scripted autopilot, and against the stand-in itself."""

import numpy as np

from uam_control.offboard.exchange import Reported, Request
from uam_control.offboard.modes import MavResult, Mode, Severity
from uam_control.offboard.offboard_parameters import OffboardParameters
from uam_control.offboard.sequence import OffboardSequence, Phase
from uam_control.setpoints.targets import AttitudeTarget
from uam_sim_bridge.autopilot.core import Autopilot

DOWN = np.array([0.0, 0.0, -9.81])


def run(sequence, seconds, start, connected=True, armed=False, mode=Mode.HOLD):
    """Tick with constant answers; return the requests with their times."""
    requested, seen = [], Reported(connected, armed, mode)
    for k in range(round(seconds / 0.004)):
        request = sequence.update(start + k * 0.004, seen)
        if request:
            requested.append((round(start + k * 0.004, 3), request))
    return requested


def flying():
    s = OffboardSequence()
    s.set_desired(True)
    run(s, 1.1, 0.0)
    run(s, 0.1, 1.1, mode=Mode.OFFBOARD)
    run(s, 0.1, 1.2, armed=True, mode=Mode.OFFBOARD)
    assert s.phase is Phase.FLYING
    return s


def test_order_and_times():
    s = OffboardSequence()
    s.set_desired(True)
    assert run(s, 1.0, 0.0, connected=False) == []
    assert s.phase is Phase.WAITING and not s.streaming
    requested = run(s, 1.8, 1.0)
    assert requested == [(2.0, Request.OFFBOARD), (2.5, Request.OFFBOARD)]
    assert s.streaming
    requested = run(s, 0.1, 2.8, mode=Mode.OFFBOARD)
    assert requested == [(2.8, Request.ARM)]
    run(s, 0.004, 2.9, armed=True, mode=Mode.OFFBOARD)
    assert s.phase is Phase.FLYING


def test_streams_but_requests_nothing_until_desired():
    s = OffboardSequence()
    assert run(s, 5.0, 0.0) == []
    assert s.streaming and s.phase is Phase.STREAMING


HEADING = "Preflight Fail: heading estimate not stable"
KILL = "Preflight Fail: Kill switch engaged"


def test_what_a_normal_start_also_brings_is_a_reason_only_if_it_lasts():
    s = OffboardSequence(OffboardParameters(stream_time=0.0, reason_delay=5.0, attempts=100))
    s.set_desired(True)
    for tick in range(1200):
        now = 0.01 * tick
        asked = s.update(now, Reported(True, False, Mode.OFFBOARD))
        if asked is not None:
            s.answer(asked, MavResult.TEMPORARILY_REJECTED)
            s.text(2, HEADING)
        if tick == 1:
            s.text(2, KILL)
        found = "; ".join(s.reasons)
        assert (KILL in found) is (tick >= 1)  # not one of them: at once
        if now < 5.0:
            assert HEADING not in found and "arming refused" not in found
        elif now >= 5.6:
            assert HEADING in found and "arming refused (temporarily" in found
    s.update(12.0, Reported(True, True, Mode.OFFBOARD))
    assert s.phase is Phase.FLYING and s.reasons == ()
    s.text(2, HEADING)  # in flight
    assert HEADING in s.reasons[0]


def test_no_offboard_signal_counts_from_the_stream_on():
    s, text = OffboardSequence(OffboardParameters(stream_time=1.0)), "No offboard signal"
    s.set_desired(True)
    s.update(0.0, Reported(True, False, Mode.HOLD))
    s.text(3, text)
    assert s.phase is Phase.STREAMING and s.reasons == ()
    s.update(1.1, Reported(True, False, Mode.HOLD))
    s.text(3, text)
    assert s.phase is Phase.OFFBOARD and text in s.reasons[0]


def test_a_failure_says_what_might_have_passed():
    s = OffboardSequence(OffboardParameters(stream_time=0.0, reason_delay=60.0, attempts=3))
    s.set_desired(True)
    for tick in range(300):
        asked = s.update(0.01 * tick, Reported(True, False, Mode.OFFBOARD))
        if asked is not None:
            s.text(2, HEADING)
    assert s.phase is Phase.FAILED
    assert HEADING in s.reasons[0] and "no success after 3 requests" in s.reasons[-1]


def test_gives_up_with_the_reasons():
    s = OffboardSequence(OffboardParameters(attempts=3))
    s.set_desired(True)
    run(s, 1.1, 0.0)
    s.answer(Request.OFFBOARD, MavResult.TEMPORARILY_REJECTED)
    s.text(Severity.CRITICAL, "no offboard signal")
    s.text(Severity.INFO, "chatter")
    requested = run(s, 5.0, 1.1)
    assert len(requested) == 2 and s.phase is Phase.FAILED
    message = "; ".join(s.reasons)
    assert "OFFBOARD refused (temporarily rejected)" in message
    assert "no offboard signal" in message and "chatter" not in message
    assert "no success after 3 requests" in s.reasons[-1]
    s.set_desired(False)
    s.set_desired(True)
    assert run(s, 0.1, 6.1) and s.phase is Phase.OFFBOARD


def test_unexpected_disarm_is_a_failure():
    s = flying()
    run(s, 0.1, 2.0, armed=False, mode=Mode.OFFBOARD)
    assert s.phase is Phase.FAILED and "disarmed by itself" in s.reasons[-1]


def test_disarm():
    s = flying()
    s.set_desired(False)
    assert run(s, 0.1, 2.0, armed=True, mode=Mode.OFFBOARD) == [(2.0, Request.DISARM)]
    s.answer(Request.DISARM, MavResult.TEMPORARILY_REJECTED)
    run(s, 0.1, 3.0, armed=False, mode=Mode.OFFBOARD)
    assert s.phase is Phase.DISARMED and s.reasons == () and s.streaming


def test_a_vehicle_that_arms_after_the_mission_gave_up_is_disarmed():
    """The answer to the request to arm was under way."""
    s = OffboardSequence()
    s.set_desired(True)
    run(s, 1.1, 0.0)
    assert run(s, 0.1, 1.1, mode=Mode.OFFBOARD) == [(1.1, Request.ARM)]
    s.set_desired(False)
    assert run(s, 0.5, 1.2, mode=Mode.OFFBOARD) == []
    assert run(s, 0.1, 1.7, armed=True, mode=Mode.OFFBOARD) == [(1.7, Request.DISARM)]
    run(s, 0.1, 1.8, mode=Mode.OFFBOARD)
    assert s.phase is Phase.DISARMED


def test_a_vehicle_that_somebody_arms_later_is_left_alone():
    s = OffboardSequence()
    s.set_desired(True)
    run(s, 1.1, 0.0)
    run(s, 0.1, 1.1, mode=Mode.OFFBOARD)
    s.set_desired(False)
    run(s, 3.0, 1.2, mode=Mode.OFFBOARD)
    assert run(s, 5.0, 4.2, armed=True, mode=Mode.POSITION) == []


def test_a_gap_of_the_link_while_disarming_changes_nothing():
    s = flying()
    s.set_desired(False)
    run(s, 0.1, 2.0, armed=True, mode=Mode.OFFBOARD)
    assert s.phase is Phase.DISARMING
    run(s, 1.0, 2.1, connected=False, armed=True, mode=Mode.OFFBOARD)
    assert run(s, 0.1, 3.1, armed=True, mode=Mode.OFFBOARD) == [(3.1, Request.DISARM)]
    run(s, 0.1, 3.2, mode=Mode.OFFBOARD)
    assert s.phase is Phase.DISARMED


def test_stream_goes_on_when_heartbeats_stop_in_flight():
    s = flying()
    run(s, 1.0, 2.0, connected=False, armed=True, mode=Mode.OFFBOARD)
    assert s.streaming and s.phase is Phase.FLYING


def test_a_failure_outlasts_the_loss_of_the_link():
    """Disarmed in the air, then silence, then back: nothing is armed by itself."""
    s = flying()
    run(s, 0.1, 2.0, armed=False, mode=Mode.OFFBOARD)
    assert s.phase is Phase.FAILED
    run(s, 5.0, 2.1, connected=False)
    assert run(s, 30.0, 7.1) == [] and s.phase is Phase.FAILED and s.streaming
    s.set_desired(False)
    s.set_desired(True)
    assert run(s, 0.1, 37.1, mode=Mode.OFFBOARD) == [(37.1, Request.ARM)]


def test_reboot_in_flight_is_the_end():
    s = flying()
    s.rebooted(2.0)
    assert s.phase is Phase.FAILED and "rebooted in flight" in s.reasons[-1]
    assert run(s, 30.0, 2.0) == []
    run(s, 5.0, 32.0, connected=False)
    assert run(s, 30.0, 37.0) == []


def test_reboot_on_the_ground_starts_over_with_a_new_stream():
    s = OffboardSequence()
    s.set_desired(True)
    run(s, 1.2, 0.0)
    run(s, 0.3, 1.2, mode=Mode.OFFBOARD)
    assert s.phase is Phase.ARMING
    s.rebooted(1.5)
    assert s.phase is Phase.STREAMING and "the autopilot rebooted" in s.reasons[-1]
    assert run(s, 1.1, 1.5) == [(2.5, Request.OFFBOARD)]
    waiting = OffboardSequence()
    waiting.rebooted(0.0)
    assert waiting.phase is Phase.WAITING and waiting.reasons == ()


def test_with_the_stand_in():
    """Vision comes late: arming is refused in words, then succeeds; auto-disarm ends it."""
    autopilot, s = Autopilot(), OffboardSequence()
    s.set_desired(True)
    received, flying_at = set(), None
    for k in range(2500):
        t = k * 0.004
        if t > 3.0:
            autopilot.vision(t, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
        status = autopilot.status
        request = s.update(t, Reported(True, status.armed, status.mode))
        autopilot.target(t, AttitudeTarget.of_rates(np.zeros(3), 0.0))
        if request:
            command, parameters = s.commands[request]
            s.answer(request, autopilot.command(t, command, parameters))
        for severity, text in autopilot.commander.take_texts():
            s.text(severity, text)
        received.update(s.reasons)
        if flying_at is None and s.phase is Phase.FLYING:
            flying_at = t
        autopilot.update(t, np.zeros(3), DOWN)
    assert s.phase is Phase.FLYING and 3.0 < flying_at < 4.0
    assert any("vision" in reason for reason in received)
    assert s.reasons == ()


def test_offboard_is_not_requested_again_in_the_autopilots_failsafe():
    s = flying()
    s.let_go = True
    assert run(s, 5.0, 2.0, armed=True, mode=Mode.LAND) == []
    assert run(s, 5.0, 7.0, armed=False, mode=Mode.HOLD) == []  # nor to arm, once it has landed
    s.set_desired(False)
    assert run(s, 5.0, 12.0, armed=False, mode=Mode.HOLD) == []
