"""The recorder over real ROS: published messages are in the file, at the right time."""

import itertools
import json
import signal
import time

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool

from uam_lab.records.recording.mcap_reader import UnreadableLog, read_log
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import SetpointWriter
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.messages.ros_time import set_stamp
from uam_msgs_py.messages.serialized import type_name
from uam_msgs_py.messages.tf_message import transforms_message
from uam_msgs_py.node.wiring import WRITERS, Connections

MODULE = "uam_lab.records.recorder"
TICK = 4_000_000
SETPOINT = "/uam/setpoint"


@pytest.fixture
def recorder(start, tmp_path, probe):
    """Start a recorder; return (process, file, statistics file)."""
    file, statistics = tmp_path / "log.mcap", tmp_path / "recorder.json"
    running = start(MODULE, "--ros-args", "-p", f"file:={file}", "-p", f"statistics:={statistics}")
    running.until_logged("[recorder]: ")
    return running, file, statistics


def connected(probe, *publishers):
    """Wait until both ends are connected."""
    connections = Connections(probe.node)
    probe.until(
        lambda: all(
            p.get_subscription_count() and connections.count("recorder", WRITERS, p.topic_name)
            for p in publishers
        ),
        "the recorder listens",
    )


def absolute(topic):
    """The topic's name in a log without a namespace."""
    return f"/{topic.name.removeprefix('/')}"


def decoded(file):
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, message.log_time, content)
            for _, channel, message, content in reader.iter_decoded_messages()
        ]


def flushed(file):
    """Stamps of the setpoints that are in the file so far; before the first flush it is empty."""
    try:
        found = read_log(file).get(SETPOINT)
    except UnreadableLog:
        return []
    return found.times if found else []


def test_every_message_is_there_at_its_simulated_time(recorder, probe):
    running, file, statistics = recorder
    clock, setpoint, magnet = (
        probe.publisher(topic) for topic in (topics.CLOCK, topics.SETPOINT, topics.MAGNET)
    )
    connected(probe, clock, setpoint, magnet)
    writer, now = SetpointWriter(), Clock()
    for k in range(1, 301):
        set_stamp(now.clock, k * TICK)
        clock.publish(now)
        setpoint.publish(writer.fill(k * TICK - 1000, [0.0, 0.0, 0.001 * k], 0.5))
        magnet.publish(Bool(data=k > 150))
        time.sleep(0.001)
    assert running.interrupt() == 0
    found = decoded(file)
    sent = [(time, content) for topic, time, content in found if topic == SETPOINT]
    assert [time for time, _ in sent] == [k * TICK - 1000 for k in range(1, 301)]
    assert [content.twist.angular.z for _, content in sent] == [0.001 * k for k in range(1, 301)]
    # a message without a stamp gets the time of /clock at its publication
    switched = [(time, content.data) for topic, time, content in found if topic == "/uam/magnet"]
    assert switched == [(k * TICK, k > 150) for k in range(1, 301)]
    report = json.loads(statistics.read_text())
    assert report["lost"] == {} and report["messages"]["/uam/setpoint"] == 300


def test_a_gap_in_the_sequence_is_counted_as_lost(recorder, probe):
    running, file, statistics = recorder
    setpoint = probe.publisher(topics.SETPOINT)
    connected(probe, setpoint)
    writer, sent = SetpointWriter(), itertools.count()

    def publish():
        k = next(sent)
        setpoint.publish(writer.fill(k, [0.0, 0.0, 0.0], 0.5))
        return k

    def written_after(newest):
        """Which have been written once a newer one than `newest` has: that may take its time."""
        for _ in range(1000):
            publish()
            time.sleep(0.02)
            written = flushed(file)
            if written and written[-1] > newest:
                return written
        raise AssertionError(f"nothing after {newest} is written")

    times = written_after(-1)
    for _ in range(20):  # a short stop may lose no message
        if len(times) <= times[-1] - times[0]:
            break
        running.process.send_signal(signal.SIGSTOP)
        for _ in range(5000):
            newest = publish()
        running.process.send_signal(signal.SIGCONT)
        times = written_after(newest)
    assert running.interrupt() == 0
    report = json.loads(statistics.read_text())
    times = read_log(file)[SETPOINT].times  # contains the last messages
    assert report["messages"][SETPOINT] == len(times)
    assert report["lost"][SETPOINT] == times[-1] - times[0] + 1 - len(times) > 0


def test_a_simulation_learns_its_progress_at_each_poll(start, tmp_path, probe):
    never = ["-p", "flush_period:=60.0"]
    start(MODULE, "--ros-args", "-p", f"file:={tmp_path / 'log.mcap'}", *never)
    clock, told = probe.publisher(topics.CLOCK), probe.collect(topics.RECORDED_UNTIL)
    now = Clock()

    def reported(tick):
        set_stamp(now.clock, tick * TICK)
        clock.publish(now)  # again and again: the recorder may not be connected yet
        return tick * TICK in map(stamp_of, told)

    for tick in (1, 2, 3):
        probe.until(lambda tick=tick: reported(tick), "the recorder's progress")


def test_the_progress_is_told_again_as_a_message_may_be_lost(recorder, probe):
    told = probe.collect(topics.RECORDED_UNTIL)
    probe.until(lambda: len(told) >= 2, "the progress twice")
    assert set(map(stamp_of, told)) == {0}


def test_a_killed_recorder_leaves_what_was_flushed(recorder, probe):
    running, file, _ = recorder
    setpoint = probe.publisher(topics.SETPOINT)
    connected(probe, setpoint)
    writer, sent = SetpointWriter(), itertools.count()

    def after_one_more():
        setpoint.publish(writer.fill(next(sent) * TICK, [0.0, 0.0, 0.0], 0.5))
        time.sleep(0.01)
        return len(flushed(file))

    counts = (after_one_more() for _ in range(1000))  # a full chunk is written anyway, but later
    kept = next((count for count in counts if count >= 50), 0)
    assert kept, "no flush while it records"
    for _ in range(10):
        after_one_more()  # these may be lost
    running.process.kill()
    running.process.wait()
    times = read_log(file)[SETPOINT].times
    assert times == [k * TICK for k in range(len(times))]
    assert len(times) >= kept


def test_a_full_disk_is_announced_and_ends_the_log_alone(start, probe):
    received = probe.collect(topics.DIAGNOSTICS)
    running = start(MODULE, "--ros-args", "-p", "file:=/dev/full")
    running.until_logged("the log cannot be written: No space left on device; recorded until 0 s")
    shown_text = "the log cannot be written: No space left on device"
    probe.until(lambda: any(m.status[0].message == shown_text for m in received), "it is announced")
    assert running.interrupt() == 0
    assert "Traceback" not in running.output


def test_a_file_that_cannot_be_written_is_named(start):
    running = start(MODULE, "--ros-args", "-p", "file:=/proc/nowhere/log.mcap")
    assert running.process.wait(60) == 2
    assert "recorder: file: cannot write /proc/nowhere/log.mcap: No such file" in running.output
    assert "Traceback" not in running.output


def test_an_existing_log_is_refused_in_one_line(start, tmp_path):
    file = tmp_path / "log.mcap"
    file.write_text("a flight")
    running = start(MODULE, "--ros-args", "-p", f"file:={file}")
    assert running.process.wait(60) == 2
    said = [line for line in running.output.splitlines() if line]
    assert said == [f"recorder: file: {file} exists; a log is never overwritten, give another name"]
    assert file.read_text() == "a flight"


def test_without_a_name_each_log_is_a_bag_of_its_own(start, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        running = start(MODULE)
        running.until_logged("[recorder]: ")
        time.sleep(1.0)  # the name has the second
        assert running.interrupt() == 0
    logs = sorted(tmp_path.rglob("*.mcap"))
    assert len(logs) == 2
    for log in logs:
        assert log.name == "log.mcap"
        with AnyReader([log.parent]) as reader:
            assert {c.topic for c in reader.connections} == {
                absolute(topic) for topic in topics.RECORDED
            }


def test_the_log_of_every_topic_is_read_by_rosbags(recorder, probe):
    running, file, _ = recorder
    serialized = [t for t in topics.RECORDED if t.type is topics.TF.type]
    publishers = {topic.name: probe.publisher(topic) for topic in topics.RECORDED}
    connected(probe, *publishers.values())
    for topic in topics.RECORDED:
        message = transforms_message([]) if topic in serialized else topic.type()
        publishers[topic.name].publish(message)
    time.sleep(0.5)
    assert running.interrupt() == 0
    seen = {}
    with AnyReader([file.parent]) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            seen[connection.topic] = message.__msgtype__
    assert seen == {absolute(topic): type_name(topic.type) for topic in topics.RECORDED}
