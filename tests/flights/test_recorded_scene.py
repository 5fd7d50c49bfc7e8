"""What a flight records to be seen, and that the views refer to nothing else."""

import pytest
import view_files
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

SHOWN = ("/tf", "/tf_static", "/robot_description", "/uam/markers", "/uam/tracking/error")


class Log:
    """A log's last messages by topic, with their types; and all transforms."""

    def __init__(self, file):
        self.kinds, self.flown, self.counts, self.frames = {}, {}, {}, set()
        with file.open("rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            channels = reader.get_summary()
            for channel in channels.channels.values():
                self.kinds[channel.topic] = channels.schemas[channel.schema_id].name
            for _, channel, _, content in reader.iter_decoded_messages():
                topic = channel.topic
                self.counts[topic] = self.counts.get(topic, 0) + 1
                if getattr(content, "points", True):  # not idle
                    self.flown[topic] = content
                for entry in getattr(content, "transforms", ()):
                    self.frames |= {entry.header.frame_id, entry.child_frame_id}


@pytest.fixture(scope="module")
def log(shared_flights):
    return Log(shared_flights.single.out / "log.mcap")


def test_what_is_shown_is_recorded_with_its_schema(log):
    assert set(SHOWN) <= set(log.flown)
    assert log.kinds["/tf"] == log.kinds["/tf_static"] == "tf2_msgs/msg/TFMessage"
    assert log.counts["/robot_description"] == log.counts["/tf_static"] == 1
    seconds = log.counts["/uam/state"] / 250.0
    assert log.counts["/tf"] > 2.0 * seconds, "some a second, however busy the machine is"
    vehicle = {"world", "base_link", "shoulder", "link_1", "link_2", "magnet", "end_effector"}
    assert vehicle | {"reference", "payload"} == log.frames


def test_the_foxglove_layout_refers_to_what_is_recorded(log):
    topics, fields, frames = view_files.foxglove()
    assert topics <= set(log.flown) and frames <= log.frames
    for path in fields:
        topic, dot, rest = path.partition(".")
        found = view_files.value_at(log.flown[topic], dot + rest)
        assert isinstance(found, int | float | str), path
    configured, placed = view_files.foxglove_panels()
    assert configured == placed


def test_the_plotjuggler_layout_refers_to_what_is_recorded(log):
    known = set()
    for topic, message in log.flown.items():
        known |= view_files.curves(topic, log.kinds[topic], message)
    assert view_files.plotjuggler() - known == set()


def test_the_rviz_configuration_refers_to_what_is_recorded(log):
    topics, frames, _ = view_files.rviz()
    assert set(topics) <= set(log.flown) and frames <= log.frames
    assert topics["/robot_description"] == topics["/uam/markers"] == "Transient Local"
