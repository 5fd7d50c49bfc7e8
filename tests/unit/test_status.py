"""Conversion of states to key-value pairs of a diagnostic message and back."""

import pytest

from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.status import ERROR, OK, STALE, WARN, AutopilotState, MissionStatus


@pytest.mark.parametrize(
    ("state", "level"),
    [
        (AutopilotState(), STALE),
        (AutopilotState(True, "OFFBOARD", True, 12_000_000_000), OK),
        (AutopilotState(True, "OFFBOARD", True, 12_000_000_000, "", 0.008), OK),
        (AutopilotState(True, "AUTO.LAND", True, 5, "setpoint lost"), WARN),
        (AutopilotState(True, "HOLD", True, 5, "", 0.008, "the pilot, in HOLD", True), WARN),
    ],
)
def test_autopilot_state_round_trip(state, level):
    message = state.to_message(7)
    assert message.status[0].level == level
    assert AutopilotState.from_message(message) == (7, state)


def test_mission_status_round_trip():
    status = MissionStatus("carry", 41.25, 0.01, 0.02, 0.03, False, "")
    message = status.to_message(3_000_000_001)
    assert message.status[0].level == OK
    assert MissionStatus.from_message(message) == (3_000_000_001, status)
    given_up = MissionStatus(phase="aborted", done=True, abort_reason="tilt").to_message(1)
    assert given_up.status[0].level == ERROR and given_up.status[0].message == "tilt"


def test_a_mission_that_holds_is_a_warning_and_an_older_log_has_no_states():
    holding = MissionStatus("hold", state="holding", cause="tilt").to_message(1)
    assert holding.status[0].level == WARN
    del holding.status[0].values[-len(MissionStatus.LATER) :]
    assert MissionStatus.from_message(holding)[1] == MissionStatus("hold")


def test_a_released_vehicle_is_a_warning_that_names_who_has_control():
    released = AutopilotState(True, "HOLD", True, 5, released_to="the pilot, in HOLD")
    assert released.summary == "HOLD, armed; the pilot, in HOLD, has control"
    message = MissionStatus("released", state="released", regains=2).to_message(1)
    assert message.status[0].level == WARN
    assert MissionStatus.from_message(message)[1].regains == 2
    old = released.to_message(1)
    del old.status[0].values[-len(AutopilotState.LATER) :]
    assert AutopilotState.from_message(old)[1] == AutopilotState(True, "HOLD", True, 5)


def test_missing_or_invalid_entries_are_refused():
    message = MissionStatus().to_message(0)
    with pytest.raises(BadMessage, match="no status 'autopilot'"):
        AutopilotState.from_message(message)
    message.status[0].values[1].value = "soon"
    with pytest.raises(BadMessage, match="'time' is 'soon'"):
        MissionStatus.from_message(message)
    del message.status[0].values[1]
    with pytest.raises(BadMessage, match="'time' is missing"):
        MissionStatus.from_message(message)
