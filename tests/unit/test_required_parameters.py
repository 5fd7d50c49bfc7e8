"""Parameters that a vehicle needs: rules, differences, requests over a link, diagnostic status."""

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from memory_transport import Memory

from uam_control.offboard.firmware import FIRMWARES
from uam_control.offboard.modes import Mode
from uam_control.offboard.sequence import OffboardSequence
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_control.settings.configuration import ConfigurationError, path
from uam_control.vehicle import load_description
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.parameter_comparison import ParameterComparison, ParameterDifference
from uam_msgs_py.messages.status import ERROR, OK, STALE, AutopilotState
from uam_sim_bridge.autopilot.params import Parameters
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, clean_text, mavlink2
from uam_sim_bridge.mavlink.telemetry.parameter_check import (
    ATTEMPTS,
    BATCH,
    WRITES,
    setting,
    value_of,
)
from uam_sim_bridge.mavlink.telemetry.required_parameters import VEHICLE, RequiredParameters, Rule
from uam_sim_bridge.nodes.autopilot_topics import comparison

RULES = RequiredParameters.read(VEHICLE)
SIMULATION = yaml.safe_load(path("px4/sitl.yaml").read_text())
RELAXED = yaml.safe_load(path("px4/vehicle.yaml").read_text())["relaxed"]


def test_each_value_that_simulation_relaxes_is_refused_on_a_vehicle():
    assert {"CBRK_SUPPLY_CHK", "COM_LOW_BAT_ACT", "COM_RC_IN_MODE", "COM_ARM_WO_GPS"} <= set(
        RELAXED
    )
    for name in RELAXED:
        assert not RULES[name].met(SIMULATION[name]), name


def test_what_mocap_needs_is_the_same_in_simulation_and_on_a_vehicle():
    shared = set(SIMULATION) & set(RULES) - set(RELAXED)
    assert {"EKF2_EV_CTRL", "EKF2_HGT_REF", "COM_OBL_RC_ACT"} <= shared
    for name in shared:
        assert RULES[name].met(SIMULATION[name]), name


def having(parameters):
    """Return the required parameters that the stand-in has."""
    return {name: parameters[name] for name in RULES if name in parameters.names}


def test_the_stand_in_of_a_rehearsal_has_what_a_vehicle_needs():
    played = Parameters.of(load_description(), path("px4/rehearsed.yaml"))
    assert RULES.differences(having(played)) == ()
    plain = Parameters.of(load_description())
    left = {one.name for one in RULES.differences(having(plain))}
    assert set(RELAXED) <= left


@pytest.mark.parametrize(
    ("rule", "good", "bad", "text"),
    [
        (Rule("", values=(2.0, 3.0)), [2, 3, 3.0001], [0, 1, 2.5], "2 or 3"),
        (Rule("", values=(894281.0,)), [894281], [0, 894381], "894281"),
        (Rule("", bits=11), [11, 15], [0, 3, 8], "bits 11"),
        (Rule("", least=0.5, most=1.0), [0.5, 0.75, 1.0, 1.00001], [0.4, 1.1], "0.5 to 1"),
        (Rule("", least=1.0), [1, 18], [0, -1], "at least 1"),
        (Rule("", most=3.0), [3, -2], [3.5], "at most 3"),
    ],
)
def test_rules(rule, good, bad, text):
    assert all(rule.met(value) for value in good)
    assert not any(rule.met(value) for value in (*bad, float("nan"), float("inf")))
    assert rule.required == text


@given(st.floats(allow_nan=True, allow_infinity=True), st.sampled_from(sorted(RULES)))
def test_a_difference_is_reported_exactly_if_the_rule_is_not_met(value, name):
    found = RULES.differences({name: value}, unanswered=False)
    assert [one.name for one in found] == ([] if RULES[name].met(value) else [name])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[1]", "a mapping expected"),
        ("a: 3", "a: a mapping expected"),
        ("a: {X: 3}", "a.X: a mapping expected"),
        ("a: {X: {is: 3}}", "a.X.why is missing"),
        ("a: {X: {why: w}}", "a.X: no rule; one of is, one_of"),
        ("a: {X: {was: 1, why: w}}", "a.X.was: unknown"),
        ("a: {X: {is: 1, most: 2, why: w}}", "only least and most"),
        ("a: {X: {is: high, why: w}}", "a.X.is: a number expected, got 'high'"),
        ("a: {X: {one_of: [], why: w}}", "one_of: a list of numbers expected"),
        ("a: {X: {bits: 0, why: w}}", "bits: a whole number expected, 1, 2, .., got 0"),
        ("a: {X: {least: 2, most: 1, why: w}}", "least 2 is above most 1"),
        ("a: {X: {is: 1, why: w}}\nb: {X: {is: 2, why: w}}", "b.X: is there twice"),
    ],
)
def test_bad_files_are_refused_in_one_line(text, message, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(ConfigurationError) as error:
        RequiredParameters.read(str(file))
    assert message in str(error.value) and "\n" not in str(error.value)


class Vehicle:
    """A link with required parameters, and an autopilot that answers requests from `values`."""

    def __init__(self, values):
        self.values, self.requests, self.writes, self.armed = values, [], [], False
        self.memory, self.time = Memory(), 0.0
        mapping = RateThrustParameters.of(load_description())
        self.link = OffboardLink(self.memory, OffboardSequence(), mapping, required=RULES)
        self.codec, self.framer = Codec(1, 1), Framer(Codec(1, 1))

    def run(self, seconds):
        """Tick every 0.1 s; return the number of requests per tick with requests."""
        counts = []
        for _ in range(round(seconds / 0.1)):
            beat = mavlink2.MAVLink_heartbeat_message(
                2, 12, 129 if self.armed else 1, FIRMWARES["px4"].custom_mode(Mode.HOLD), 3, 3
            )
            self.send(beat)
            self.link.poll(self.time)
            self.link.tick(self.time)
            messages = [
                m for frame in self.memory.to_autopilot for m in self.framer.datagram(frame)
            ]
            self.writes += [m for m in messages if m.get_type() == "PARAM_SET"]
            names = [
                clean_text(m.param_id) for m in messages if m.get_type() == "PARAM_REQUEST_READ"
            ]
            self.memory.to_autopilot.clear()
            self.requests += names
            counts += [len(names)] if names else []
            for name in names:
                if name in self.values:
                    value = self.values[name]
                    kind = mavlink2.MAV_PARAM_TYPE_REAL32
                    self.send(
                        mavlink2.MAVLink_param_value_message(name.encode(), value, kind, 900, 1)
                    )
            self.time += 0.1
        return counts

    def send(self, message):
        self.memory.to_link.append(self.codec.encode(message))


def good_values():
    """Values that meet every rule, and those of the mapping."""
    values = dict.fromkeys(FIRMWARES["px4"].watched, 0.15)
    for name, rule in RULES.items():
        values[name] = rule.values[0] if rule.values else rule.bits or rule.least
    return values


def test_a_vehicle_as_required_passes():
    vehicle = Vehicle(good_values())
    assert comparison(vehicle.link.parameters).level == STALE
    counts = vehicle.run(5.0)
    assert max(counts) <= BATCH and sum(counts) == len(set(FIRMWARES["px4"].watched) | set(RULES))
    found = comparison(vehicle.link.parameters)
    assert found.passed and found.level == OK and found.read == found.required == len(RULES)


@pytest.mark.parametrize("there", [*RULES.instead])
def test_a_parameter_that_a_version_of_px4_renamed_is_read_under_either_name(there):
    (absent,) = set(RULES.instead) - {there}
    values = {name: value for name, value in good_values().items() if name != absent}
    vehicle = Vehicle(values)
    vehicle.run(2.0)
    watch = vehicle.link.parameters
    assert watch.complete and comparison(watch).passed
    assert comparison(watch).read == comparison(watch).required == len(RULES) - 1
    assert RULES.differences({name: values[name] for name in values if name != there})
    vehicle = Vehicle(values | {there: -1.0 if there == "MAN_OVERRIDE_SPD" else 1.0})
    vehicle.run(2.0)
    assert [one.name for one in vehicle.link.parameters.differences] == [there]


def test_values_of_the_simulation_are_differences():
    values = good_values() | {name: float(SIMULATION[name]) for name in RELAXED}
    vehicle = Vehicle(values)
    vehicle.run(5.0)
    found = comparison(vehicle.link.parameters)
    assert not found.passed and found.level == ERROR
    assert {one.name for one in found.differences} == set(RELAXED)
    assert all(name in found.summary for name in RELAXED)
    assert any(
        text.startswith("CBRK_SUPPLY_CHK is 894281, 0 required") for text in vehicle.link.warnings
    )


def test_a_parameter_without_an_answer_is_a_difference_after_all_requests():
    values = good_values()
    del values["RC_MAP_KILL_SW"]
    vehicle = Vehicle(values)
    vehicle.run(2.0)
    assert comparison(vehicle.link.parameters).level == STALE
    vehicle.run(10.0)
    found = comparison(vehicle.link.parameters)
    assert found.complete and [one.name for one in found.differences] == ["RC_MAP_KILL_SW"]
    assert found.differences[0].found is None
    assert vehicle.requests.count("RC_MAP_KILL_SW") == ATTEMPTS


def test_a_changed_parameter_is_compared_again():
    vehicle = Vehicle(good_values())
    vehicle.run(5.0)
    vehicle.send(
        mavlink2.MAVLink_param_value_message(
            b"COM_RC_IN_MODE", 4.0, mavlink2.MAV_PARAM_TYPE_REAL32, 900, 1
        )
    )
    vehicle.run(0.1)
    found = comparison(vehicle.link.parameters)
    assert [one.name for one in found.differences] == ["COM_RC_IN_MODE"]


def stored(name, value):
    """The answer of an autopilot to PARAM_SET."""
    return mavlink2.MAVLink_param_value_message(
        name.encode(), value, mavlink2.MAV_PARAM_TYPE_REAL32, 900, 1
    )


def test_parameters_are_written_only_if_desired_and_disarmed():
    wrong = {"SYS_HITL": 1.0, "COM_LOW_BAT_ACT": 0.0}  # 0 required; 2 or 3 required: not written
    for writing, armed in ((False, False), (True, True), (True, False)):
        vehicle = Vehicle(good_values() | wrong)
        vehicle.link.parameters.writing = writing
        vehicle.armed = armed
        vehicle.run(3.0)
        writes = [(clean_text(m.param_id), m.param_value) for m in vehicle.writes]
        if not writing or armed:
            assert writes == [] and vehicle.link.parameters.written == ()
            continue
        assert writes == [("SYS_HITL", 0.0)] * WRITES  # no answer: repeated, not for ever
        assert vehicle.link.parameters.written == ("SYS_HITL was 1: set to 0",)
        assert {one.name for one in vehicle.link.parameters.differences} == set(wrong)
        vehicle.send(stored("SYS_HITL", 0.0))
        vehicle.run(0.1)
        assert [one.name for one in vehicle.link.parameters.differences] == ["COM_LOW_BAT_ACT"]
        vehicle.send(stored("SYS_HITL", 1.0))  # changed by somebody else: it stays
        vehicle.run(2.0)
        assert len(vehicle.writes) == WRITES
        assert {one.name for one in vehicle.link.parameters.differences} == set(wrong)


# other integers look like a signalling NaN in the float field, which no Python keeps
@given(st.integers(-(2**22), 2**31 - 2**23 - 1), st.floats(width=32, allow_nan=False))
def test_a_written_value_arrives_as_it_is(integer, real):
    for value, kind in (
        (integer, mavlink2.MAV_PARAM_TYPE_INT32),
        (real, mavlink2.MAV_PARAM_TYPE_REAL32),
    ):
        (message,) = Framer(Codec(1, 191)).datagram(
            Codec(1, 1).encode(setting("A", value, kind, 1))
        )
        assert value_of(message) == value


def test_the_status_beside_the_autopilots_state():
    differences = (
        ParameterDifference("CBRK_SUPPLY_CHK", 894281.0, "0", "a reason"),
        ParameterDifference("RC_MAP_KILL_SW", None, "1 to 18", 'with "quotes"'),
    )
    made = ParameterComparison(25, 26, True, differences)
    message = AutopilotState().to_message(7)
    assert ParameterComparison.from_message(message) is None
    message.status = [*message.status, made.to_status()]
    assert ParameterComparison.from_message(message) == made
    assert AutopilotState.from_message(message) == (7, AutopilotState())
    message.status[1].values[-1].value = "{"
    with pytest.raises(BadMessage, match="autopilot parameters"):
        ParameterComparison.from_message(message)
