"""A log is read back by the public readers and by ours, whole or cut off."""

import os

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from uam_lab.records.recording.bag import schema
from uam_lab.records.recording.bounded_log import BoundedLog
from uam_lab.records.recording.mcap_reader import (
    HEADER,
    TopicLog,
    UnreadableLog,
    read_log,
    read_metadata,
)

rclpy_serialization = pytest.importorskip("rclpy.serialization")
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
SECOND = 10**9


def serialized(k):
    from builtin_interfaces.msg import Duration, Time
    from std_msgs.msg import Header
    from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

    point = JointTrajectoryPoint(
        positions=[0.1 * k, 2.0], effort=[-1.0], time_from_start=Duration(sec=k, nanosec=5)
    )
    message = JointTrajectory(
        header=Header(stamp=Time(sec=k, nanosec=4_000_000), frame_id="world"),
        joint_names=["x", "y"],
        points=[point],
    )
    return rclpy_serialization.serialize_message(message)


def filled(path, chunks, size=2):
    """An open log of `chunks` chunks with `size` messages each, and its length after each."""
    log = BoundedLog(path, limit=0.0)
    log.add_metadata("flight", {"seed": "3"})
    channel = log.add_channel("/uam/state", TRAJECTORY, schema(TRAJECTORY), {"a": "b"})
    lengths = []
    for k in range(chunks * size):
        log.write(channel, k * SECOND, k * SECOND + 7, serialized(k), k)
        if (k + 1) % size == 0:
            log.flush()
            lengths.append(path.stat().st_size)
    return log, lengths


def test_the_public_reader_decodes_what_was_written(tmp_path):
    log, _ = filled(tmp_path / "log.mcap", 3)
    log.close()
    log.close()
    assert log.ended == "" and log.counts == {"/uam/state": 6}
    with (tmp_path / "log.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        assert [m.metadata for m in reader.iter_metadata()] == [{"seed": "3"}]
        summary = reader.get_summary()
        assert summary.statistics.message_count == 6
        assert summary.channels[1].metadata == {"a": "b"}
        decoded = list(reader.iter_decoded_messages())
        times = reader.iter_messages(starting_at=3 * SECOND, ending_before=5 * SECOND)
        assert [message.log_time for _, _, message in times] == [3 * SECOND, 4 * SECOND]
    for k, (kind, channel, message, content) in enumerate(decoded):
        assert (kind.name, kind.encoding, channel.topic) == (TRAJECTORY, "ros2msg", "/uam/state")
        reported = (message.log_time, message.publish_time, message.sequence)
        assert reported == (k * SECOND, k * SECOND + 7, k)
        assert content.header.stamp.sec == k and content.header.frame_id == "world"
        assert list(content.joint_names) == ["x", "y"]
        assert list(content.points[0].positions) == [0.1 * k, 2.0]
        assert list(content.points[0].effort) == [-1.0]
        assert content.points[0].time_from_start.nanosec == 5


def test_our_reader_gives_the_same_and_only_the_topics_that_were_named(tmp_path):
    log, messages = BoundedLog(tmp_path / "log.mcap", limit=0.0), [serialized(0), serialized(1)]
    channel = log.add_channel("/uam/state", TRAJECTORY, schema(TRAJECTORY), {})
    for k, message in enumerate(messages):
        log.write(channel, k * SECOND, k * SECOND + 7, message, k)
    log.close()
    expected = TopicLog(TRAJECTORY, [0, SECOND], messages, [7, SECOND + 7])
    assert read_log(tmp_path / "log.mcap") == {"/uam/state": expected}
    assert read_log(tmp_path / "log.mcap", lambda name: name == "/other") == {}


def test_a_log_cut_off_anywhere_is_read_up_to_there(tmp_path):
    file, cut = tmp_path / "log.mcap", tmp_path / "cut.mcap"
    log, lengths = filled(file, 3)
    assert read_log(file)["/uam/state"].times == [k * SECOND for k in range(6)]  # never closed
    log.close()
    cut.write_bytes(file.read_bytes())
    for length in reversed(range(lengths[0], cut.stat().st_size)):
        os.truncate(cut, length)
        chunks = sum(length >= there for there in lengths)
        # A chunk counts from its last byte on; the index of its messages follows.
        found = len(read_log(cut)["/uam/state"].times)
        assert 2 * chunks <= found <= 2 * min(chunks + 1, 3)
        assert read_metadata(cut) == {"flight": {"seed": "3"}}


def test_a_damaged_chunk_is_left_out_and_said(tmp_path):
    file = tmp_path / "log.mcap"
    log, lengths = filled(file, 3, size=100)
    log.close()
    whole, said = file.read_bytes(), []
    times = [k * SECOND for k in range(300)]
    assert read_log(file, note=said.append)["/uam/state"].times == times and not said
    _, length = HEADER.unpack_from(whole, lengths[0])
    begin = lengths[0] + HEADER.size
    for at in range(begin + 24, begin + length, length // 40):  # behind times and size
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        said.clear()
        found = read_log(file, note=said.append)["/uam/state"].times
        assert found == times[:100] + times[200:], at
        assert said == [
            "log.mcap is damaged: 1 of its records cannot be read, their messages are missing"
        ]
    first = whole[: lengths[0] // 2] + b"\0" + whole[lengths[0] // 2 + 1 :]  # with the channels
    file.write_bytes(first)
    with pytest.raises(UnreadableLog, match="log.mcap is damaged: 1 of its records"):
        read_log(file)


def test_an_empty_log_opens(tmp_path):
    BoundedLog(tmp_path / "log.mcap", limit=0.0).close()
    with (tmp_path / "log.mcap").open("rb") as file:
        assert make_reader(file).get_summary().statistics.message_count == 0
    assert read_log(tmp_path / "log.mcap") == {}


def test_what_is_no_log_is_refused(tmp_path):
    (tmp_path / "log.mcap").write_text("something else")
    with pytest.raises(UnreadableLog, match="not an MCAP file"):
        read_log(tmp_path / "log.mcap")
