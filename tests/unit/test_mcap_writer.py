"""The log file, read back with the public readers."""

import pytest
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, make_reader
from mcap_ros2.decoder import DecoderFactory

from uam_lab.recording.mcap_writer import McapWriter
from uam_lab.recording.message_definitions import (
    DefinitionMissing,
    dependencies,
    schema,
)

rclpy_serialization = pytest.importorskip("rclpy.serialization")
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"


def trajectory(k):
    from builtin_interfaces.msg import Duration, Time
    from std_msgs.msg import Header
    from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

    point = JointTrajectoryPoint(
        positions=[0.1 * k, 2.0], effort=[-1.0], time_from_start=Duration(sec=k, nanosec=5)
    )
    return JointTrajectory(
        header=Header(stamp=Time(sec=k, nanosec=4_000_000), frame_id="world"),
        joint_names=["x", "y"],
        points=[point],
    )


def write(path, count, chunks=1):
    writer = McapWriter(path)
    channel = writer.add_channel("/uam/state", TRAJECTORY, schema(TRAJECTORY), {"a": "b"})
    for k in range(count):
        data = rclpy_serialization.serialize_message(trajectory(k))
        writer.write(channel, k * 10**9, k * 10**9 + 7, data, sequence=k)
        if (k + 1) % (count // chunks) == 0:
            writer.flush()
    return writer


def test_the_public_reader_decodes_what_was_written(tmp_path):
    with write(tmp_path / "log.mcap", 6, chunks=3) as writer:
        writer.add_metadata("flight", {"seed": "3"})
        assert writer.counts == {"/uam/state": 6}
    with (tmp_path / "log.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        assert [m.metadata for m in reader.iter_metadata()] == [{"seed": "3"}]
        summary = reader.get_summary()
        assert summary.statistics.message_count == 6
        assert summary.statistics.chunk_count == len(summary.chunk_indexes) == 3
        assert summary.statistics.message_end_time == 5 * 10**9
        assert summary.channels[1].metadata == {"a": "b"}
        decoded = list(reader.iter_decoded_messages())
    for k, (kind, channel, message, content) in enumerate(decoded):
        assert (kind.name, kind.encoding, channel.topic) == (TRAJECTORY, "ros2msg", "/uam/state")
        assert (message.log_time, message.publish_time, message.sequence) == (
            k * 10**9,
            k * 10**9 + 7,
            k,
        )
        assert content.header.stamp.sec == k and content.header.frame_id == "world"
        assert list(content.joint_names) == ["x", "y"]
        assert list(content.points[0].positions) == [0.1 * k, 2.0]
        assert list(content.points[0].effort) == [-1.0]
        assert content.points[0].time_from_start.nanosec == 5


def test_a_time_range_is_found_through_the_index(tmp_path):
    write(tmp_path / "log.mcap", 10, chunks=5).close()
    with (tmp_path / "log.mcap").open("rb") as file:
        found = make_reader(file).iter_messages(starting_at=3 * 10**9, ending_before=5 * 10**9)
        assert [message.log_time for _, _, message in found] == [3 * 10**9, 4 * 10**9]


def test_what_was_flushed_survives_the_death_of_the_recorder(tmp_path):
    writer = write(tmp_path / "log.mcap", 6, chunks=3)  # flushed, never closed
    found = []
    with (tmp_path / "log.mcap").open("rb") as file, pytest.raises(McapError):
        for _, _, message in NonSeekingReader(file).iter_messages(log_time_order=False):
            found.append(message.sequence)
    assert found == [0, 1, 2, 3, 4, 5]
    writer.close()


def test_closing_twice_keeps_the_file(tmp_path):
    writer = write(tmp_path / "log.mcap", 2)
    writer.close()
    size = (tmp_path / "log.mcap").stat().st_size
    writer.close()
    assert (tmp_path / "log.mcap").stat().st_size == size


def test_an_empty_log_opens(tmp_path):
    McapWriter(tmp_path / "log.mcap").close()
    with (tmp_path / "log.mcap").open("rb") as file:
        assert make_reader(file).get_summary().statistics.message_count == 0


def test_a_schema_holds_every_dependency_once():
    text = schema("sensor_msgs/msg/Imu")
    for name in ("std_msgs/Header", "geometry_msgs/Quaternion", "geometry_msgs/Vector3"):
        assert text.count(f"MSG: {name}\n") == 1
    assert text.count("MSG: builtin_interfaces/Time\n") == 1
    assert "float64[9] orientation_covariance" in text


def test_constants_comments_and_primitives_are_no_dependencies():
    assert dependencies("std_msgs/msg/Bool") == []
    assert dependencies("diagnostic_msgs/msg/DiagnosticStatus") == ["diagnostic_msgs/msg/KeyValue"]
    assert dependencies("trajectory_msgs/msg/JointTrajectory") == [
        "std_msgs/msg/Header",
        "trajectory_msgs/msg/JointTrajectoryPoint",
    ]


def test_an_unknown_type_is_named():
    with pytest.raises(DefinitionMissing, match="no_such_msgs"):
        schema("no_such_msgs/msg/Thing")
    with pytest.raises(DefinitionMissing, match="std_msgs/msg/Thing"):
        schema("std_msgs/msg/Thing")
