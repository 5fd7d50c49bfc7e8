"""What the log of a flight costs: writing it by `mcap`, decoding it by our own code, in one run.

    .venv/bin/python benchmarks/recording.py [results/latest/log.mcap] [--runs 5]

Takes the messages of a recorded flight. Two questions, two ratios, CPU time on one core:

- writing: `mcap.writer.Writer` against the least that any writer in Python does (a packed header,
  the message, compression, no index). The difference, times the messages of a second of flight,
  is what a writer of our own could save.
- decoding: `mcap_ros2` and `rclpy`, message by message, against `logged_topics`, a topic at a time.
"""

from __future__ import annotations

import argparse
import struct
import tempfile
import time
import zlib
from collections.abc import Callable
from pathlib import Path

import zstandard
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rclpy.serialization import deserialize_message
from trajectory_msgs.msg import JointTrajectory

from uam_lab.records.recording import logged_topics
from uam_lab.records.recording.bag import schema
from uam_lab.records.recording.bounded_log import BoundedLog
from uam_lab.records.recording.mcap_reader import TopicLog, read_log
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.serialized import type_name

MESSAGES = 100_000  # the first of the flight
DECODED = 2_000
FLUSH = 2_000  # messages between two flushes: half a second of flight
FASTER = 2.0  # a flight in lockstep runs at about twice real time
HEADER = struct.Struct("<BQHIQQ")
Flown = list[tuple[int, int, str, bytes]]  # published, log time [ns], topic, message


def in_order(logs: dict[str, TopicLog]) -> Flown:
    """The first messages of a flight in the order in which they were published."""
    return sorted(
        (published, time, topic, data)
        for topic, log in logs.items()
        for time, published, data in zip(log.times, log.published, log.messages, strict=True)
    )[:MESSAGES]


def write_with_library(flown: Flown, logs: dict[str, TopicLog], file: Path) -> None:
    """Write as the recorder does."""
    log = BoundedLog(file, limit=0.0)
    channels = {
        topic: log.add_channel(topic, found.type_name, schema(found.type_name), {})
        for topic, found in logs.items()
    }
    for number, (published, stamp, topic, data) in enumerate(flown):
        log.write(channels[topic], stamp, published, data, number)
        if number % FLUSH == 0:
            log.flush()
    log.close()


def write_least(flown: Flown, file: Path) -> None:
    """Write the same bytes, without index, statistics and records other than messages."""
    compressor = zstandard.ZstdCompressor()
    with file.open("wb") as output:
        chunk = bytearray()
        for number, (published, stamp, _, data) in enumerate(flown):
            chunk += HEADER.pack(5, HEADER.size + len(data), 1, number, stamp, published)
            chunk += data
            if number % FLUSH == 0:
                zlib.crc32(chunk)
                output.write(compressor.compress(chunk))
                chunk = bytearray()


def best(runs: int, *actions: Callable[[], object]) -> list[float]:
    """The least CPU time [s] of each action; they take turns, so that all see one machine."""
    found = [float("inf")] * len(actions)
    for _ in range(runs):
        for number, action in enumerate(actions):
            before = time.process_time()
            action()
            found[number] = min(found[number], time.process_time() - before)
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path, nargs="?", default=Path("results/latest/log.mcap"))
    parser.add_argument("--runs", type=int, default=5, help="the best of so many (default 5)")
    options = parser.parse_args()
    logs = read_log(options.log)
    flown = in_order(logs)
    state = logs[topics.STATE.name]
    messages, name = state.messages[:DECODED], type_name(JointTrajectory)
    text = Schema(id=1, name=name, encoding="ros2msg", data=schema(name).encode())
    decode = DecoderFactory().decoder_for("cdr", text)
    with tempfile.TemporaryDirectory() as folder:
        library, least = best(
            options.runs,
            lambda: write_with_library(flown, logs, Path(folder) / "library.mcap"),
            lambda: write_least(flown, Path(folder) / "least.bin"),
        )
    ours, by_mcap, by_rclpy = best(
        options.runs,
        lambda: logged_topics.read_blocks(name, messages),
        lambda: [decode(data) for data in messages],
        lambda: [deserialize_message(data, JointTrajectory) for data in messages],
    )
    simulated = (max(m[1] for m in flown) - min(m[1] for m in flown if m[1])) / 1e9
    rate = len(flown) / simulated  # [1/s]
    share = 100.0 * FASTER * rate * (library - least) / len(flown)
    cost = 1e6 * library / len(flown)
    print(f"writing   {cost:.2f} us a message by mcap, {library / least:.1f} x the least")
    print(f"          {rate:.0f} messages a second of flight: {share:.1f} % of a core to save")
    print(f"decoding  {1e6 * ours / len(messages):.2f} us a message by logged_topics")
    print(f"          mcap_ros2 {by_mcap / ours:.0f} x, rclpy {by_rclpy / ours:.0f} x that")


if __name__ == "__main__":
    main()
