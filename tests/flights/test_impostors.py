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

from uam_control.settings import configuration
from uam_lab.processes.node_environment import transport_environment
from uam_lab.results import timeseries
from uam_msgs_py.messages.status import ERROR

DOMAIN = "98"
PROGRAM = Path(__file__).parents[1] / "impostor.py"
# nobody in the flight listens to it but the recorder
ONLY_RECORDED = "/uam/arm/command"


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def disturbed(tmp_path_factory, short_scenario):
    """A flight among impostors that were there before it."""
    assert configuration.path("dds/fastdds.xml").exists()
    surroundings = {**os.environ, **transport_environment(), "ROS_DOMAIN_ID": DOMAIN}
    impostor = subprocess.Popen([sys.executable, str(PROGRAM)], env=surroundings)
    flight = Flight(
        tmp_path_factory.mktemp("disturbed"),
        *("--scenario", str(short_scenario), "--seed", "3", "--domain", DOMAIN),
    )
    try:
        status = flight.wait()
        assert impostor.poll() is None
        assert status == 0, flight.said + flight.complained
        yield flight
    finally:
        impostor.kill()
        impostor.wait()
        flight.end()


def test_the_flight_is_that_without_impostors(disturbed, two_flights):
    series, single = (
        timeseries.read(flight.out / "timeseries.parquet") for flight in (disturbed, two_flights[0])
    )
    assert series.values.tobytes() == single.values.tobytes()


def test_each_impostor_is_named_with_the_rightful_node(disturbed):
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
