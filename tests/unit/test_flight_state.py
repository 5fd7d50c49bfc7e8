"""Mode and arming: reports that are older than the answer to a request, and a pilot's decision."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from uam_control.offboard.exchange import Reported, Request
from uam_control.offboard.modes import Mode
from uam_control.offboard.offboard_parameters import OffboardParameters
from uam_control.offboard.sequence import OffboardSequence, Phase
from uam_sim_bridge.mavlink.link.flight_state import SETTLING, FlightState

TICK = 0.004  # [s]


def connected():
    state = FlightState()
    state.take_heartbeat(0.0, Mode.POSITION, armed=False)
    return state


def test_a_report_older_than_the_answer_does_not_take_it_back():
    state = connected()
    state.take_accepted(1.0, Request.OFFBOARD)
    state.take_heartbeat(1.004, Mode.POSITION, armed=False)
    assert state.mode is Mode.OFFBOARD
    state.take_current_mode(1.02, Mode.OFFBOARD, Mode.OFFBOARD, landed=True)
    state.settle(2.0)
    assert state.mode is Mode.OFFBOARD
    state.take_accepted(3.0, Request.ARM)
    state.take_heartbeat(3.004, Mode.OFFBOARD, armed=False)
    assert state.armed and state.armed_since == 3.0
    state.take_heartbeat(4.004, Mode.OFFBOARD, armed=False)
    assert not state.armed and state.armed_since is None


def test_a_pilots_mode_counts_as_soon_as_the_answer_has_settled():
    state = connected()
    state.take_accepted(1.0, Request.OFFBOARD)
    state.take_current_mode(1.05, Mode.POSITION, Mode.POSITION, landed=False)
    state.settle(1.0 + SETTLING - TICK)
    assert state.mode is Mode.OFFBOARD and state.intended is Mode.POSITION
    state.settle(1.0 + SETTLING)
    assert state.mode is Mode.POSITION
    state.take_current_mode(2.0, Mode.OFFBOARD, Mode.OFFBOARD, landed=False)
    state.take_current_mode(2.004, Mode.HOLD, Mode.HOLD, landed=False)
    assert state.mode is Mode.HOLD  # at once: nothing was requested


def test_offboard_after_disarming_is_the_heartbeats_to_say():
    state = connected()
    state.take_current_mode(1.0, Mode.OFFBOARD, Mode.OFFBOARD, landed=True)
    assert state.mode is Mode.POSITION
    state.take_heartbeat(1.5, Mode.OFFBOARD, armed=False)
    assert state.mode is Mode.OFFBOARD


@given(
    heartbeat=st.floats(0.0, 1.0),
    published=st.floats(0.001, 0.03),
    delay=st.sampled_from([0.0, 0.004, 0.05, 0.3]),
)
def test_a_heartbeat_at_any_moment_of_the_start_does_not_end_it(heartbeat, published, delay):
    """An autopilot that publishes a state `published` [s] after it has accepted the request."""
    state, sequence = FlightState(), OffboardSequence(OffboardParameters(stream_time=0.1))
    sequence.set_desired(True)
    true_mode, true_armed = Mode.POSITION, False
    to_come, sent = [], []  # (when, mode or armed), (when received, call)
    beat, phases, now = heartbeat, [], 0.0
    state.take_heartbeat(0.0, true_mode, true_armed)
    while now < 3.0:
        now += TICK
        for at, change in [one for one in to_come if one[0] <= now]:
            to_come.remove((at, change))
            if isinstance(change, Mode):
                true_mode = change
            else:
                true_armed = change
            mode = true_mode
            sent.append(
                (now + delay, lambda t, m=mode: state.take_current_mode(t, m, m, landed=True))
            )
        if now >= beat:
            beat += 1.0
            seen = true_mode, true_armed
            sent.append((now + delay, lambda t, seen=seen: state.take_heartbeat(t, *seen)))
        for at, take in [one for one in sent if one[0] <= now]:
            sent.remove((at, take))
            take(now)
        state.settle(now)
        request = sequence.update(now, Reported(True, state.armed, state.mode, state.intended))
        phases.append(sequence.phase)
        if request is not None:
            change = Mode.OFFBOARD if request is Request.OFFBOARD else True
            to_come.append((now + delay + published, change))
            sent.append((now + 2 * delay, lambda t, r=request: state.take_accepted(t, r)))
    steps = [b for a, b in pairwise([None, *phases]) if a is not b]
    assert steps[-3:] == [Phase.OFFBOARD, Phase.ARMING, Phase.FLYING]
