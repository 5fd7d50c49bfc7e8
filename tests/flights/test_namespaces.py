"""Two vehicles fly at once in one ROS domain, each in its namespace and its simulated world."""

import json

from mcap.reader import make_reader

from uam_lab.records.results import timeseries

SHARED = {"/tf", "/tf_static", "/diagnostics", "/rosout"}


def test_two_vehicles_of_a_domain_fly_as_single_ones(shared_flights):
    single = timeseries.read(shared_flights.single.out / "timeseries.parquet")
    for flight in (shared_flights.uav1, shared_flights.uav2):
        series = timeseries.read(flight.out / "timeseries.parquet")
        assert series.values.tobytes() == single.values.tobytes()
        assert series.phases.tolist() == single.phases.tolist()
        figures, alone = (
            json.loads((one.out / "metrics.json").read_text())
            for one in (flight, shared_flights.single)
        )
        assert figures["mission_completed"] and figures["rms"] == alone["rms"]


def test_the_log_of_a_vehicle_has_its_own_topics_and_frames(shared_flights):
    for name, other in (("uav1", "uav2"), ("uav2", "uav1")):
        flight = getattr(shared_flights, name)
        with (flight.out / "log.mcap").open("rb") as file:
            found = make_reader(file).get_summary().channels.values()
        topics = {channel.topic for channel in found}
        assert topics - SHARED == {one for one in topics if one.startswith(f"/{name}/")}
        assert f"/{name}/clock" in topics and SHARED <= topics
        with (flight.out / "log.mcap").open("rb") as file:
            seen = set()
            for _, channel, message in make_reader(file).iter_messages(topics=sorted(SHARED)):
                seen.add(channel.topic)
                own = f"{name}.{{}}" if channel.topic == "/rosout" else f"{name}/{{}}"
                assert own.format("").encode() in message.data, channel.topic
                assert f"{other}/".encode() not in message.data, channel.topic
            assert seen == SHARED
