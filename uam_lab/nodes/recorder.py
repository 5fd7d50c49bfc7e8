"""Records every topic of the stack to an MCAP file.

Messages are taken raw and not decoded. The node polls its subscriptions instead of using
callbacks: the threads of the middleware collect the messages, and taking fifty messages in one
poll costs a tenth of fifty callbacks.

Log time is simulation time: the stamp in the header. For types without a header, and for
/diagnostics, whose publishers may not have received a tick yet, it is the last /clock published
before the message. Publish time is the publisher's wall clock. With `simulated: false` (on
hardware, without /clock) both are wall time.
"""

import json
import sys
import time
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

from uam_control.settings.parameter_set import ParameterError
from uam_control.stamps import SECOND
from uam_lab.recording.bounded_log import BoundedLog
from uam_lab.recording.message_definitions import schema
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.messages.serialized import type_name
from uam_msgs_py.messages.status import ERROR, OK, WARN, diagnostic
from uam_msgs_py.node import connections
from uam_msgs_py.node.base_node import StopSignal, refuse
from uam_msgs_py.node.health import LoopTime, ages
from uam_msgs_py.node.node_parameters import refuse_unknown
from uam_msgs_py.node.polling import listen

DEPTH = 2000  # queue length per topic: 8 s at control rate
CLOCK = "/clock"


def begins_with_stamp(message_type: type) -> bool:
    """Return whether `stamp_of` applies to the message type."""
    fields = list(message_type.get_fields_and_field_types().items())
    return fields[0] in (("header", "std_msgs/Header"), ("clock", "builtin_interfaces/Time"))


@dataclass
class Track:
    """One recorded topic."""

    topic: str
    subscription: Subscription
    message_type: type
    stamped: bool
    channel: int
    one_publisher: bool
    arrived: float | None = None  # time.monotonic() of the newest message
    last_sequence: int = 0
    lost: int = 0


class TopicRecorder:
    """The open file and its subscriptions."""

    def __init__(
        self,
        node: Node,
        file: Path,
        chosen: list[topics.Topic],
        simulated: bool,
        metadata: Mapping[str, Mapping[str, str]] | None = None,
        size_limit: float = 0.0,
    ):
        """Subscribe to `chosen` and create `file` with the named texts `metadata`.

        size_limit [MB], 0 for none.
        """
        self._simulated = simulated
        self._writer = BoundedLog(file, size_limit)
        for name, values in (metadata or {}).items():
            self._writer.add_metadata(name, values)
        self._tracks = [self._track(node, topic) for topic in chosen]
        # /clock is taken last in each poll: then every /clock published before any other message
        # of this poll is available
        self._tracks.sort(key=lambda track: track.topic == CLOCK)
        self._clock_wall: list[int] = []  # publisher's wall clock of each /clock [ns]
        self._clock_sim: list[int] = []

    def _track(self, node: Node, topic: topics.Topic) -> Track:
        qos = QoSProfile(
            history=QoSHistoryPolicy.KEEP_LAST,
            depth=DEPTH,
            reliability=topic.reading.reliability,
            durability=topic.qos.durability,
        )
        subscription = listen(node, topic, qos, raw=True)
        name = type_name(topic.type)
        metadata = {"offered_qos_profiles": _qos_text(topic.qos)}
        channel = self._writer.add_channel(topic.name, name, schema(name), metadata)
        stamped = begins_with_stamp(topic.type) and topic.one_publisher
        return Track(topic.name, subscription, topic.type, stamped, channel, topic.one_publisher)

    def poll(self) -> int:
        """Write all received messages; return their number."""
        batch, now = [], time.monotonic()
        for track in self._tracks:
            take = track.subscription.handle.take_message
            while (taken := take(track.message_type, True)) is not None:
                data, info = taken
                published = info["source_timestamp"]
                if track.topic == CLOCK:
                    self._clock_wall.append(published)
                    self._clock_sim.append(stamp_of(data))
                sequence = info["publication_sequence_number"]
                self._count_lost(track, sequence)
                batch.append((track, data, published, sequence))
                track.arrived = now
        for track, data, published, sequence in batch:
            at = stamp_of(data) if track.stamped else self._sim_time(published)
            self._writer.write(track.channel, max(at, 0), published, data, sequence & 0xFFFFFFFF)
        del self._clock_wall[:-DEPTH], self._clock_sim[:-DEPTH]
        return len(batch)

    def drain(self, quiet: float = 0.2, longest: float = 1.0) -> None:
        """Write the last messages until none arrives for `quiet` [s], for at most `longest` [s]."""
        now = last = time.monotonic()
        end = now + longest
        while now - last < quiet and now < end:
            if self.poll():
                last = time.monotonic()
            time.sleep(quiet / 10.0)
            now = time.monotonic()

    def _sim_time(self, published: int) -> int:
        """Return the simulation time [ns] at the wall time `published` [ns]."""
        if not self._simulated:
            return published
        before = bisect_right(self._clock_wall, published)
        return self._clock_sim[before - 1] if before else 0

    @staticmethod
    def _count_lost(track: Track, sequence: int) -> None:
        if track.one_publisher and 0 < track.last_sequence < sequence - 1:
            track.lost += sequence - 1 - track.last_sequence
        track.last_sequence = sequence

    @property
    def inlets(self) -> dict[str, Subscription]:
        """The subscriptions by topic."""
        return {track.topic: track.subscription for track in self._tracks}

    @property
    def arrivals(self) -> dict[str, float]:
        """time.monotonic() of the newest message of each topic with messages."""
        return {t.topic: t.arrived for t in self._tracks if t.arrived is not None}

    def flush(self) -> None:
        """Flush the written messages to the file."""
        self._writer.flush()

    @property
    def ended(self) -> str:
        """Reason of the end of the recording, "" while it runs."""
        return self._writer.ended

    @property
    def until(self) -> float:
        """Simulation time [s] of the newest /clock, 0 before the first."""
        return self._clock_sim[-1] / SECOND if self._clock_sim else 0.0

    @property
    def lost(self) -> dict[str, int]:
        """Number of lost messages, for topics with losses."""
        return {track.topic: track.lost for track in self._tracks if track.lost}

    @property
    def counts(self) -> dict[str, int]:
        """Messages written, per topic."""
        return self._writer.counts

    def close(self) -> None:
        """Write the index and close the file."""
        lost = {topic: str(count) for topic, count in self.lost.items()}
        self._writer.add_metadata("lost messages", lost)
        self._writer.close()


def _qos_text(qos: QoSProfile) -> str:
    """Return the QoS in the form of rosbag2 for a channel's metadata."""
    transient = qos.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL
    return "\n".join(
        [
            "- history: keep_last",
            f"  depth: {qos.depth}",
            f"  reliability: {'reliable' if qos.reliability.name == 'RELIABLE' else 'best_effort'}",
            f"  durability: {'transient_local' if transient else 'volatile'}",
        ]
    )


def _health(node: Node, recording: TopicRecorder, polls: LoopTime) -> DiagnosticArray:
    """Return the node's /diagnostics entry: lost messages, loop times, connections."""
    lost = sum(recording.lost.values())
    summary = recording.ended or (f"{lost} messages lost" if lost else "recording")
    values = {"messages lost": lost, connections.RECORDED_UNTIL: recording.until}
    values |= polls.report("poll") | ages(recording.inlets, recording.arrivals)
    values |= connections.of({}, recording.inlets)
    now = node.get_clock().now().nanoseconds
    level = ERROR if recording.ended else WARN if lost else OK
    return diagnostic(now, node.get_name(), level, summary, values)


def main() -> int:
    """Record until SIGINT or SIGTERM, then complete the file."""
    # the signal must not close the ROS context: received messages are still to be written
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    stop = StopSignal()
    node = Node("recorder", start_parameter_services=False)
    file = Path(node.declare_parameter("file", "log.mcap").value)
    statistics = node.declare_parameter("statistics", "").value
    facts = node.declare_parameter("facts", "").value  # see flight/log_facts.py
    simulated = node.declare_parameter("simulated", True).value
    flush_period = node.declare_parameter("flush_period", 0.5).value
    size_limit = float(node.declare_parameter("size_limit", 0.0).value)  # [MB], 0: none
    poll_period = node.declare_parameter("poll_period", 0.02).value
    try:
        refuse_unknown(node)
        known = json.loads(Path(facts).read_text()) if facts else None
        recording = TopicRecorder(node, file, topics.ALL, simulated, known, size_limit)
    except ParameterError as error:
        return refuse("recorder", error)
    except OSError as error:
        print(f"recorder: cannot write {file}: {error.strerror}", flush=True)
        return 1
    health = node.create_publisher(
        topics.DIAGNOSTICS.type, topics.DIAGNOSTICS.name, topics.DIAGNOSTICS.qos
    )
    print(f"recorder: {len(topics.ALL)} topics to {file}", flush=True)
    polls_per_flush = max(1, round(flush_period / poll_period))
    polls, loop, ended = 0, LoopTime(), ""
    while not stop.raised:
        time.sleep(poll_period)
        begun = time.perf_counter()
        recording.poll()
        loop.add(begun)
        polls += 1
        if polls % polls_per_flush == 0:
            recording.flush()
            if recording.ended and not ended:
                ended = recording.ended
                print(f"recorder: {ended}; recorded until {recording.until:g} s", flush=True)
            health.publish(_health(node, recording, loop))
    recording.drain()
    recording.close()
    for topic, count in recording.lost.items():
        print(f"recorder: {count} messages of {topic} were lost", flush=True)
    if statistics:
        summary = {"messages": recording.counts, "lost": recording.lost, "ended": recording.ended}
        Path(statistics).write_text(json.dumps(summary, indent=1))
    node.destroy_node()
    rclpy.shutdown()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
