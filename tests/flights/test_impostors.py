"""Second publishers on every topic of the control loop: the flight is unaffected, each is named."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from impostor import LOOP, name_of
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from whole_flight import Flight

from uam_lab.flights.processes.node_environment import transport_environment
from uam_lab.records.results import timeseries
from uam_msgs_py.messages.status import ERROR
from uam_sim_bridge.ports import Reservation

# A starved process loses messages among those of the impostors: the flight needs a quiet machine.
pytestmark = pytest.mark.slow
IMPOSTOR = Path(__file__).parents[1] / "impostor.py"

# nobody in the flight listens to it but the recorder
ONLY_RECORDED = "/uam/arm/command"


@pytest.fixture(scope="module")
def among_impostors(tmp_path_factory, short_scenario):
    """The flight `single` of shared_flights once more, in a namespace, among impostors."""
    with Reservation() as reserved:
        domain = str(reserved.ports.domain)
        surroundings = {**os.environ, **transport_environment(), "ROS_DOMAIN_ID": domain}
        impostors = subprocess.Popen([sys.executable, IMPOSTOR, "uav1"], env=surroundings)
        options = ("--scenario", str(short_scenario), "--seed", "3", "--domain", domain)
        flight = Flight(tmp_path_factory.mktemp("impostors"), *options, "--namespace", "uav1")
        try:
            status = flight.wait()
            assert impostors.poll() is None
        finally:
            impostors.kill()
            impostors.wait()
            flight.end()
    assert status == 0, flight.said + flight.complained
    return flight


def test_the_flight_is_that_without_impostors(among_impostors, shared_flights):
    series, single = (
        timeseries.read(flight.out / "timeseries.parquet")
        for flight in (among_impostors, shared_flights.single)
    )
    assert series.values.tobytes() == single.values.tobytes()


def test_each_impostor_is_named_with_the_rightful_node(among_impostors):
    disturbed = among_impostors
    errors = []
    with (disturbed.out / "log.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, _, _, message in reader.iter_decoded_messages(topics=["/diagnostics"]):
            for status in message.status:
                values = {pair.key: pair.value for pair in status.values}
                errors.append(values.get("foreign publishers", ""))
                if bytes([status.level]) == ERROR:
                    errors.append(status.message)
    logs = "".join(file.read_text() for file in (disturbed.out / "logs").glob("*.log"))
    for topic in LOOP:
        told = [text for text in errors if f"/{name_of(topic)} (" in text]
        assert told, f"{topic.name}: nobody names {name_of(topic)}"
        assert any(f"/{topic.name}: refused" in text for text in told)
        if f"/{topic.name}" != ONLY_RECORDED:
            assert f"/{name_of(topic)} (" in logs, topic.name
