"""JSON in messages: bounded in depth, length and numbers; other texts are refused."""

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from hypothesis import given
from hypothesis import strategies as st

from uam_control.settings.json_text import DEEPEST, LONGEST, JsonError, read_json
from uam_msgs_py.messages.flight_events import FaultEvent, ParameterChange
from uam_msgs_py.messages.layouts import LONGEST_TEXT, BadMessage
from uam_msgs_py.messages.parameter_comparison import ParameterComparison
from uam_msgs_py.messages.serialized import MOST_BYTES, deserialized
from uam_msgs_py.messages.status import AutopilotState, MissionStatus, finite
from uam_sim_bridge.faults.fault import FaultError
from uam_sim_bridge.faults.schedule import Schedule
from uam_sim_bridge.laboratory.laboratory_parameters import SimulatedParameters
from uam_sim_bridge.plant.effects.network_delay import SetpointDelay

DEEP = "[" * 100_000
HALF = '"\\ud800"'


@pytest.mark.parametrize(
    "text", ["", "abc", DEEP, DEEP + "]" * 100_000, HALF, f"{{{HALF}: 1}}", "9" * 30, "9" * 5000]
)
def test_what_is_no_value_for_python_and_ros_is_refused(text):
    with pytest.raises(JsonError):
        read_json(text)


@pytest.mark.parametrize("text", ["", DEEP, "[]", "1", '{"a": ' * 2000])
def test_a_parameter_that_is_no_mapping_is_refused_in_one_line(text):
    for read in (
        lambda: SimulatedParameters.from_mapping({"vehicle_changes": text}).changes(),
        lambda: Schedule.from_text(text or " "),
        lambda: SetpointDelay.from_text(text or " "),
    ):
        with pytest.raises(ValueError, match="expected|not valid") as refused:
            read()
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize("seed", ["1e999", "null", '"1"', "NaN", "[]"])
def test_a_seed_of_faults_is_a_whole_number(seed):
    with pytest.raises(FaultError, match='"seed": N'):
        Schedule.from_text(f'{{"seed": {seed}, "faults": []}}')


def test_the_bounds_are_included():
    assert read_json("[" * DEEPEST + "]" * DEEPEST) is not None
    with pytest.raises(JsonError, match="more than 8 levels"):
        read_json("[" * (DEEPEST + 1) + "]" * (DEEPEST + 1))
    assert read_json("[1]", 2) == [1]
    with pytest.raises(JsonError, match="more than 1 levels"):
        read_json("[1]", 1)
    assert read_json(str(2**63 - 1)) == 2**63 - 1
    assert read_json('"' + "x" * (LONGEST - 2) + '"')
    with pytest.raises(JsonError, match="characters"):
        read_json('"' + "x" * LONGEST + '"')


@pytest.mark.parametrize("decode", [
    FaultEvent.from_message, ParameterChange.from_message, ParameterComparison.from_message,
    MissionStatus.from_message, AutopilotState.from_message,
])  # fmt: skip
@given(data=st.data())
def test_any_texts_are_read_or_refused(decode, data):
    texts = st.one_of(
        st.sampled_from([DEEP, f"{DEEP} -> {DEEP}", " -> " * 9000, "1 -> 2", HALF, "1", "9" * 99]),
        st.text(),
    )
    names = st.sampled_from(["by", "number", "place", "read", "required", "complete", "armed", "a"])
    known = st.sampled_from(["mission", "autopilot", ParameterComparison.NAME, "x"])
    status = DiagnosticStatus(
        name=data.draw(known),
        message=data.draw(st.sampled_from(["begun", "over", "accepted", "refused: no", "?"])),
        values=[
            KeyValue(key=k, value=v) for k, v in data.draw(st.dictionaries(names, texts)).items()
        ],
    )
    message = DiagnosticArray(status=[status] * data.draw(st.integers(0, 2)))
    try:
        decode(message)
    except BadMessage as error:
        assert "\n" not in str(error) and len(str(error)) <= LONGEST_TEXT + 3


def test_a_refusal_is_one_line_of_bounded_length():
    assert str(BadMessage("a\n  b\tc\x1b[2Jd\u202e")) == "a b c␛[2Jd�"  # none obeyed by a terminal
    assert len(str(BadMessage("x" * 10_000))) == LONGEST_TEXT + 3


def test_bytes_that_are_none_and_too_many_are_refused():
    for data in (b"", b"\0", bytes.fromhex("00010000ffffffff")):
        with pytest.raises(BadMessage, match="no DiagnosticArray"):
            deserialized(data, DiagnosticArray)
    with pytest.raises(BadMessage, match="1000001 bytes"):
        deserialized(bytes(MOST_BYTES + 1), DiagnosticArray)


@pytest.mark.parametrize("text", ["", None, "abc", "nan", "inf", "1e999"])
def test_a_diagnostic_value_that_is_no_number_has_none(text):
    assert finite(text) is None
    assert finite("1.5") == 1.5
