"""The gains of a log are stored in the columns of the same names."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rclpy")

from default_columns import COLUMNS
from diagnostic_msgs.msg import DiagnosticArray
from logged_flight import vehicles_log
from rclpy.serialization import serialize_message
from std_msgs.msg import Bool

from uam_control.laws.catalogue import LAWS
from uam_control.mission import load_scenario
from uam_control.profiles.profile import default_profile
from uam_control.vehicle import load_description
from uam_lab.flights.flight_settings import settings
from uam_lab.flights.ros.supervise import logged
from uam_lab.records.recording import log_reader, logged_topics
from uam_lab.records.recording.bag import schema
from uam_lab.records.recording.bounded_log import BoundedLog
from uam_lab.records.recording.logged_topics import ADAPTATION, Log
from uam_lab.records.recording.mcap_reader import TopicLog, UnreadableLog
from uam_lab.records.results.result_folder import ResultFolder
from uam_lab.records.results.timeseries import gain_columns
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import JointStateWriter
from uam_msgs_py.messages.flight_events import ParameterChange
from uam_msgs_py.messages.serialized import type_name
from uam_msgs_py.messages.status import MissionStatus
from uam_msgs_py.node.namespace import expanded

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("law", LAWS)
def test_the_gains_of_every_law_are_read_by_name(law):
    names = LAWS[law](default_profile(law).sets["arm_controller"]).names
    writer = JointStateWriter(names)
    messages = []
    for k in (1, 2):
        writer.position[:] = 10.0 * k + np.arange(len(names))
        messages.append(bytes(writer.stamped(20_000_000 * k)))
    topic = ADAPTATION["arm"]
    log = Log({expanded("/", topic.name): TopicLog("sensor_msgs/msg/JointState", [], messages)})
    values = np.full((3, len(COLUMNS)), np.nan)
    ticks = np.array([16_000_000, 36_000_000, 40_000_000])
    log_reader.adaptation(log, "arm", ticks, values, COLUMNS)
    columns = gain_columns("arm", names, COLUMNS)
    assert np.isnan(values[0]).all()  # nothing was said yet
    np.testing.assert_array_equal(values[1, columns], 10.0 + np.arange(len(names)))
    np.testing.assert_array_equal(values[2, columns], 20.0 + np.arange(len(names)))
    assert np.isfinite(values[2]).sum() == len(names)


def test_the_thrust_factor_holds_between_its_messages():
    writer, messages = JointStateWriter(["factor"]), []
    for k, factor in enumerate((1.0, 0.9)):
        writer.position[0] = factor
        messages.append(bytes(writer.stamped(100_000_000 * k)))
    log = Log(
        {expanded("/", topics.THRUST.name): TopicLog("sensor_msgs/msg/JointState", [], messages)}
    )
    found = log.samples(topics.THRUST, ("position",), 1)
    np.testing.assert_array_equal(found.at(np.array([4_000_000, 104_000_000]))[:, 0], [1.0, 0.9])


def test_wall_times_belong_to_their_stamps_where_two_layouts_come_mixed():
    writers = JointStateWriter(["a"]), JointStateWriter(["a", "b"])
    messages = [bytes(writers[k % 2].stamped(1000 * k)) for k in range(4)]
    found = TopicLog("sensor_msgs/msg/JointState", [], messages, [10, 11, 12, 13])
    stamps, sent = Log({expanded("/", topics.THRUST.name): found}).published(topics.THRUST)
    pairs = dict(zip(stamps.tolist(), sent.tolist(), strict=True))
    assert pairs == {0: 10, 1000: 11, 2000: 12, 3000: 13}


def written(path, *names, kind="sensor_msgs/msg/JointState"):
    """Write a log with one message on each topic."""
    log = BoundedLog(path, 0.0)
    for name in names:
        channel = log.add_channel(name, kind, schema(kind), {})
        log.write(channel, 0, 0, name.encode(), 1)
    log.close()
    return path


@pytest.mark.parametrize("space", ["", "/uav1", "/lab/uav1"])
def test_a_log_is_read_in_the_namespace_of_its_true_state(tmp_path, space):
    names = [f"{space}/{topic.name}" for topic in (topics.TRUTH_STATE, topics.THRUST)]
    log = Log.read(written(tmp_path / "log.mcap", *names, "/other/uam/thrust"))
    assert log.messages(topics.THRUST) == [names[1].encode()]


def test_a_log_of_two_vehicles_is_refused(tmp_path):
    path = written(tmp_path / "log.mcap", "/uav1/uam/truth/state", "/uav2/uam/truth/state")
    with pytest.raises(UnreadableLog, match="several vehicles: /uav1, /uav2"):
        Log.read(path)


def test_a_message_that_is_none_is_refused_in_one_line(tmp_path):
    kind = type_name(topics.STATE.type)
    log = Log.read(written(tmp_path / "log.mcap", f"/{topics.STATE.name}", kind=kind))
    with pytest.raises(
        UnreadableLog, match=f"log.mcap: a message of {topics.STATE.name} is damaged"
    ):
        log.blocks(topics.STATE)


@pytest.mark.parametrize("kind", ["std_msgs/msg/String", "sensor_msgs/msg/Imu"])
def test_a_log_of_another_program_is_refused_with_the_type(tmp_path, kind):
    path = written(tmp_path / "log.mcap", f"/{topics.REFERENCE.name}", kind=kind)
    with pytest.raises(UnreadableLog, match=f"log.mcap: uam/reference has the type {kind} in"):
        log_reader.read_flight(path, load_scenario("hover"))
    empty = written(tmp_path / "empty.mcap")
    with pytest.raises(UnreadableLog, match="empty.mcap has no reference"):
        log_reader.read_flight(empty, load_scenario("hover"))


SECOND = 1_000_000_000


def statuses_of(*entries):
    """(stamp [s], MissionStatus) from (stamp, phase, state, cause, abort_reason)."""
    return [
        (round(at * SECOND), MissionStatus(phase, state=state, cause=cause, abort_reason=reason))
        for at, phase, state, cause, reason in entries
    ]


def phases(statuses, seconds, flying):
    ticks = np.array(seconds) * SECOND
    time = np.array(seconds) - 10.0  # take-off at 10 s
    scenario = load_scenario("hover")
    return list(log_reader.phases(ticks, time, np.array(flying), scenario, statuses))


def test_phases_are_the_scenarios_unless_the_mission_left_it():
    planned = statuses_of(
        (9, "waiting", "grounded", "", ""),
        (10, "take-off", "taking off", "armed", ""),
        (24, "landed", "disarmed", "touchdown", ""),
    )
    seconds, flying = [9, 10, 14, 20, 25], [False, True, True, True, False]
    expected = ["waiting", "take-off", "hover", "land", "landed"]
    assert phases(planned, seconds, flying) == expected
    held = statuses_of(
        (9, "waiting", "grounded", "", ""),
        (10, "take-off", "taking off", "armed", ""),
        (13, "hover", "flying", "airborne", ""),
        (15, "hold", "holding", "requested", ""),
        (19.5, "land", "landing", "battery", "battery"),
        (24, "landed", "disarmed", "touchdown", "battery"),
    )
    assert phases(held, [9, 10, 14, 16, 20, 25], [False, *[True] * 4, False]) == [
        "waiting",
        "take-off",
        "hover",
        "hold",
        "land",
        "landed",
    ]
    lost = statuses_of(
        (9, "waiting", "grounded", "", ""),
        (10, "take-off", "taking off", "armed", ""),
        (15, "aborted", "failsafe", "tilt", "tilt"),
    )
    assert phases(lost, [14, 16], [True, False]) == ["hover", "aborted"]


def test_a_vehicle_whose_mission_fell_silent_is_in_the_table_to_its_end():
    truth = np.arange(0, 5_000_000_000, 4_000_000)
    assert log_reader._last_of_all(4_000_000_000, truth) == 4_000_000_000, "cut off, a little later"
    assert log_reader._last_of_all(2_000_000_000, truth) == truth[-1] + 1
    assert log_reader._last_of_all(2_000_000_000, truth[:0]) == 2_000_000_000


def test_transitions_are_reported_with_mission_time_and_cause():
    statuses = statuses_of(
        (9, "waiting", "grounded", "", ""),
        (10, "take-off", "taking off", "armed", ""),
        (10.5, "take-off", "taking off", "armed", ""),
        (12.25, "hold", "holding", "tilt", ""),
    )
    assert log_reader.transitions(statuses, 10 * SECOND) == [
        {"time_s": 0.0, "from": "grounded", "to": "taking off", "cause": "armed"},
        {"time_s": 2.25, "from": "taking off", "to": "holding", "cause": "tilt"},
    ]


def test_a_vehicles_log_has_the_estimate_in_place_of_the_truth(tmp_path):
    flight = log_reader.read_flight(vehicles_log(tmp_path), load_scenario("hover"))
    series = flight.series
    assert flight.errors_of == "estimate" and not flight.done
    assert len(series) == 749 and series.columns == COLUMNS
    np.testing.assert_allclose(series["truth.z"], 1.01)
    np.testing.assert_allclose(series["error.z"][series.flown], 0.01)
    assert series.time[series.flown][0] == 0.0
    assert np.isnan(series["rotor_1.thrust"]).all() and np.isnan(series["magnet.force"]).all()
    np.testing.assert_allclose(series["payload.y"], 2.0)
    np.testing.assert_array_equal(series["magnet.on"][[0, 499, 500]], [0.0, 0.0, 1.0])
    assert np.median(flight.latency_s) == pytest.approx(0.003) and flight.missed_ticks == 5
    assert flight.wall_s == pytest.approx(2.996)


def test_a_vehicle_that_a_pilot_flies_has_no_errors_of_its_own(tmp_path):
    log = vehicles_log(tmp_path, released=range(400, 500))
    series = log_reader.read_flight(log, load_scenario("hover")).series
    rows = series.in_phase("released")
    assert rows.sum() == 100 and series.flown[rows].all()
    np.testing.assert_allclose(series["error.z"][rows], 0.0, atol=1e-12)
    np.testing.assert_allclose(series["error.z"][series.flown & ~rows], 0.01)


def test_a_tick_is_missed_after_three_control_periods_of_the_vehicle(tmp_path):
    slower = replace(load_description(), control_period=0.008)
    flight = log_reader.read_flight(vehicles_log(tmp_path), load_scenario("hover"), vehicle=slower)
    assert max(flight.latency_s) == pytest.approx(0.02) and flight.missed_ticks == 0


class SetpointsOnly:
    """A log with setpoints at these stamps."""

    def __init__(self, stamps):
        self.stamps = np.array(stamps)

    def published(self, topic):
        assert topic is topics.SETPOINT
        return self.stamps, self.stamps


def test_ticks_that_were_not_sent_are_known_from_ticks_that_were_not_flown():
    ticks = np.arange(6)
    log = SetpointsOnly([0, 1, 2, 4])  # 3: no node answered; 5: the bridge alone is late
    states, references = np.array([0, 4, 5]), np.array([0, 1, 5])
    left_out = log_reader.withheld(log, ticks, states, references)
    np.testing.assert_array_equal(np.flatnonzero(left_out), [2])


class ReferencesOnly:
    """A log with references alone: checks by hand from 1 s on, take-off at 5 s."""

    def __init__(self, count=5, arming_commanded=True):
        self.count, self.arming_commanded = count, arming_commanded

    def blocks(self, topic):
        n = self.count
        stamps = np.array([1, 2, 5, 6, 7], dtype=np.int64)[:n] * 1_000_000_000
        fields = {row: np.zeros((n, 8)) for row in log_reader.STATE_ROWS}
        fields["time_from_start"] = np.array([0, 0, 0, 1, 2], dtype=np.int64)[:n] * 1_000_000_000
        return [logged_topics.Block(np.arange(n), stamps, [""] * 8, fields)]


def test_checks_by_hand_before_the_flight_are_no_take_off():
    assert log_reader.References(ReferencesOnly(), 8).takeoff == 5_000_000_000


def test_a_start_refused_after_checks_by_hand_has_no_take_off():
    refused = ReferencesOnly(2, arming_commanded=False)
    assert log_reader.References(refused, 8).takeoff is None


def test_a_mission_that_does_not_count_its_time_takes_off_with_its_first_reference():
    assert log_reader.References(ReferencesOnly(2), 8).takeoff == 1_000_000_000


@pytest.mark.parametrize(
    ("commands", "commanded"), [([], True), ([False], False), ([False, True, False], True)]
)
def test_arming_is_commanded_unless_the_log_says_that_it_never_was(commands, commanded):
    topic, found = topics.ARMING, TopicLog("std_msgs/msg/Bool")
    found.messages = [serialize_message(Bool(data=one)) for one in commands]
    assert Log({f"/{topic.name}": found}).arming_commanded is commanded


def test_a_message_of_something_else_is_left_out_with_a_note():
    topic, found = topics.CHANGES, TopicLog("diagnostic_msgs/msg/DiagnosticArray")
    change = ParameterChange("mission", "x", {"tilt_hold": (0.8, 0.7)}).to_message(SECOND)
    found.messages = [serialize_message(one) for one in (DiagnosticArray(), change)]
    log = Log({f"/{topic.name}": found})
    (entry,) = log_reader.parameter_changes(log, 0)
    assert (entry["node"], entry["time_s"]) == ("mission", 1.0)
    assert log.notes == [f"{topic.name}: 1 messages cannot be read; left out"]


def test_a_flight_that_ended_before_its_recorder_says_so(tmp_path):
    folder = ResultFolder(tmp_path)
    ended = logged(settings("hover"), folder, None, True, [])
    assert ended.failure == "nothing recorded: the flight ended before the recorder began"
    folder.log.write_bytes(b"no log")
    broken = logged(settings("hover"), folder, None, True, [])
    assert "nothing recorded: " in broken.failure and "before the recorder" not in broken.failure
