"""Lockstep flights through the ROS engine, whole."""

import json
import re
from collections import Counter

import numpy as np
import pytest
from default_columns import COLUMNS
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from uam_control.laws.modular import ModularLaw
from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.flights.flight_settings import settings
from uam_lab.records.recording.log_reader import read_flight
from uam_lab.records.results import timeseries
from uam_lab.records.results.metrics import errors
from uam_lab.records.results.timeseries import gain_columns
from uam_msgs_py.messages import topics
from uam_sim_bridge.plant import Vehicle

WALL = ("wall_s", "real_time_factor")  # what may differ between two runs of one flight


def metrics(flight):
    return json.loads((flight.out / "metrics.json").read_text())


def test_the_mission_is_completed_and_said_so(shared_flights):
    flight = shared_flights.single
    found = metrics(flight)
    assert found["mission_completed"] and found["abort_reason"] is None
    assert found["engine"] == "ros" and found["clock"] == "lockstep" and found["seed"] == 3
    assert "Mission completed" in flight.said
    for phase in ("take-off", "hover", "land"):
        assert phase in flight.said
    for name in ("report.html", "versions.json", "stability.json", "info.json"):
        assert (flight.out / name).stat().st_size > 0
    flown = load_profile(str(flight.out / "parameters.yaml"))
    assert flown.sets == load_profile("s500").sets


def test_one_seed_gives_one_flight(shared_flights):
    flights = shared_flights.single, shared_flights.uav2
    first, second = (metrics(flight) for flight in flights)
    for figures in (first, second):
        for key in WALL:
            figures.pop(key)
    assert first == second
    a, b = (timeseries.read(flight.out / "timeseries.parquet") for flight in flights)
    assert a.values.tobytes() == b.values.tobytes()
    assert a.phases.tolist() == b.phases.tolist()


def test_flights_side_by_side_use_different_domains_and_ports(shared_flights):
    flights = shared_flights.single, shared_flights.uav1, shared_flights.uav2
    domains = [int(flight.said.split("ROS domain ")[1].split(",")[0]) for flight in flights]
    assert domains[0] != domains[1] == domains[2] == shared_flights.domain
    assert len({flight.instance for flight in flights}) == 3


def test_the_direct_engine_flies_the_same(shared_flights, short_scenario):
    requested = settings(scenario=str(short_scenario), seed=3)
    direct = DirectFlight(requested.scenario, requested.profile, Vehicle.load(), 0.0, seed=3)
    expected = errors(direct.run().series())
    found = metrics(shared_flights.single)["rms"]
    # What is left is the single precision of MAVLink's setpoints and motor commands, which contact
    # with the ground makes larger.
    for group, figures in expected.items():
        assert found[group] == pytest.approx(figures, rel=0.02), group


def test_every_tick_is_in_the_table(shared_flights):
    series = timeseries.read(shared_flights.single.out / "timeseries.parquet")
    steps = [round(1e6 * step) for step in (series.time[1:] - series.time[:-1])]
    assert set(steps) == {4000}
    assert series.time[0] < 0.0 and 0.0 in series.time
    names = [name for name, _, _ in series.phase_spans()]
    assert names == ["waiting", "take-off", "hover", "land", "landed"]
    flown = series.values[series.flown]
    axes = {"position": 3, "attitude": 3, "arm": COLUMNS.joints}
    own = [gain_columns(name, ModularLaw.gain_names(n), COLUMNS) for name, n in axes.items()]
    others = np.ones(flown.shape[1], dtype=bool)
    others[COLUMNS.block("adaptation.")] = False
    others[np.concatenate(own)] = True
    assert not np.isnan(flown[:, others]).any(), "a number on every tick, but for other laws' gains"
    assert np.isnan(flown[:, ~others]).all()


def test_the_log_opens_with_the_public_readers_and_is_whole(shared_flights):
    flight = shared_flights.single
    with (flight.out / "log.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        counts = {
            summary.channels[number].topic: count
            for number, count in summary.statistics.channel_message_counts.items()
        }
        (lost,) = [m.metadata for m in reader.iter_metadata() if m.name == "lost messages"]
        assert lost == {}
        ticks = counts["/uam/state"]
        per_tick = ("/imu/data", "/joint_states", "/uam/position/command", "/uam/setpoint")
        assert {counts[topic] for topic in per_tick} == {ticks}
        assert counts["/arm_effort_controller/commands"] == counts["/uam/magnet"] == ticks
        assert summary.statistics.message_end_time < 60 * 10**9, "log time is simulation time"
        found = {}
        by_stamp = {t.name for t in topics.RECORDED if t.one_publisher}
        for kind, channel, message, content in reader.iter_decoded_messages():
            assert kind.encoding == "ros2msg"
            if channel.topic not in found and message.log_time > 4 * 10**9:
                found[channel.topic] = content
                if hasattr(content, "header") and channel.topic in by_stamp:
                    stamp = content.header.stamp
                    assert stamp.sec * 10**9 + stamp.nanosec == message.log_time
    assert list(found["/uam/state"].joint_names)[-1] == "alpha_2"
    assert found["/imu/data"].orientation_covariance[0] == -1.0
    assert 0.0 < found["/uam/setpoint"].twist.linear.z < 1.0


def test_the_result_folder_is_a_bag_for_rosbags(shared_flights):
    """Folder and file; every message of every type is deserialised."""
    flight = shared_flights.single
    for bag in (flight.out, flight.out / "log.mcap"):
        with AnyReader([bag]) as reader:
            counted = Counter()
            for connection, _, data in reader.messages():
                reader.deserialize(data, connection.msgtype)
                counted[connection.topic] += 1
            listed = {c.topic: c.msgcount for c in reader.connections if c.msgcount}
        assert counted == listed and counted["/uam/state"] > 1000


def test_rates_and_frames_are_those_of_the_interface_table(shared_flights):
    """docs/interfaces.md is made from this table."""
    with AnyReader([shared_flights.single.out]) as reader:
        span = (reader.end_time - reader.start_time) * 1e-9
        counts = {c.topic: c.msgcount for c in reader.connections}
        frames = {}
        for connection, _, data in reader.messages():
            if connection.topic not in frames:
                header = getattr(reader.deserialize(data, connection.msgtype), "header", None)
                frames[connection.topic] = header.frame_id if header else ""
    counts = {name.removeprefix("/"): count for name, count in counts.items()}
    frames = {name.removeprefix("/"): frame for name, frame in frames.items()}
    for topic in topics.ALL:
        if found := re.fullmatch(r"(\d+) Hz", topic.rate):
            if topic is not topics.ARM_TEMPERATURE:  # no servo driver in a simulation
                share = counts[topic.name.removeprefix("/")] / span / float(found[1])
                # the scene is no part of the lockstep: on a busy machine it leaves out frames
                least = 0.1 if topic in (topics.TF, topics.TRACKING_ERROR) else 0.9
                assert least < share < 1.1, topic.name
    for topic in (topics.IMU, topics.MOCAP, topics.STATE, topics.REFERENCE, topics.SETPOINT):
        assert frames[topic.name] == topic.frame


def test_messages_without_a_stamp_lie_at_their_tick(shared_flights):
    """Efforts are published while /clock shows the tick that they answer."""
    with (shared_flights.single.out / "log.mcap").open("rb") as file:
        times = {"/clock": [], "/arm_effort_controller/commands": []}
        for _, channel, message in make_reader(file).iter_messages(topics=list(times)):
            times[channel.topic].append(message.log_time)
    efforts = times["/arm_effort_controller/commands"]
    assert efforts == times["/clock"][-len(efforts) :]


def test_reading_the_log_again_gives_the_table(shared_flights, short_scenario):
    out = shared_flights.single.out
    again = read_flight(out / "log.mcap", load_scenario(str(short_scenario)))
    assert again.done and again.abort_reason == ""
    table = timeseries.read(out / "timeseries.parquet")
    assert again.series.values.tobytes() == table.values.tobytes()
