"""Two vehicles fly at once in one ROS domain, each in its namespace and its simulated world."""

import json

import pytest
from mcap.reader import make_reader
from whole_flight import Flight

from uam_lab.results import timeseries

DOMAIN = "99"
SHARED = {"/tf", "/tf_static", "/diagnostics", "/rosout"}


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def vehicles(tmp_path_factory, short_scenario):
    """Flights of uav1 and uav2 with the seed of `two_flights`; both have ended."""
    folder = tmp_path_factory.mktemp("vehicles")
    options = ("--scenario", str(short_scenario), "--seed", "3", "--domain", DOMAIN)
    flights = {
        name: Flight(folder / name, *options, "--namespace", name) for name in ("uav1", "uav2")
    }
    statuses = {name: flight.wait() for name, flight in flights.items()}
    for name, flight in flights.items():
        assert statuses[name] == 0, flight.said + flight.complained
    yield flights
    for flight in flights.values():
        flight.end()


def test_two_vehicles_of_a_domain_fly_as_single_ones(vehicles, two_flights):
    single = timeseries.read(two_flights[0].out / "timeseries.parquet")
    for flight in vehicles.values():
        assert f"ROS domain {DOMAIN}," in flight.said
        series = timeseries.read(flight.out / "timeseries.parquet")
        assert series.values.tobytes() == single.values.tobytes()
        assert series.phases.tolist() == single.phases.tolist()
        figures, alone = (
            json.loads((one.out / "metrics.json").read_text()) for one in (flight, two_flights[0])
        )
        assert figures["mission_completed"] and figures["rms"] == alone["rms"]


def test_the_log_of_a_vehicle_has_its_own_topics_and_frames(vehicles):
    for name, flight in vehicles.items():
        other = "uav2" if name == "uav1" else "uav1"
        with (flight.out / "log.mcap").open("rb") as file:
            found = make_reader(file).get_summary().channels.values()
        topics = {channel.topic for channel in found}
        assert topics - SHARED == {one for one in topics if one.startswith(f"/{name}/")}
        assert f"/{name}/clock" in topics and SHARED <= topics
        with (flight.out / "log.mcap").open("rb") as file:
            for _, channel, message in make_reader(file).iter_messages(topics=["/tf"]):
                assert channel.topic == "/tf"
                own = f"{name}/base_link".encode() in message.data
                assert own != (f"{other}/base_link".encode() in message.data)
