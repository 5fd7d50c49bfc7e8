"""Second publishers on every topic of the control loop: the flight is unaffected, each is named."""

from impostor import LOOP, name_of
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from uam_lab.results import timeseries
from uam_msgs_py.messages.status import ERROR

# nobody in the flight listens to it but the recorder
ONLY_RECORDED = "/uam/arm/command"


def test_the_flight_is_that_without_impostors(shared_flights):
    series, single = (
        timeseries.read(flight.out / "timeseries.parquet")
        for flight in (shared_flights.uav1, shared_flights.single)
    )
    assert series.values.tobytes() == single.values.tobytes()


def test_each_impostor_is_named_with_the_rightful_node(shared_flights):
    disturbed = shared_flights.uav1
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
