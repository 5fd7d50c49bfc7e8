"""Subscribes to topics without decoding them, and writes each message at its time of the flight.

A topic has its own name in the log, also where it is remapped: readers know it by that name. Of
topics shared by several vehicles only the own part is written, see `own_part`. Losses are gaps
in the sequence numbers of one publisher.

The subscriptions are polled and have no callbacks: the threads of the middleware collect the
messages, and taking fifty messages in one poll costs a tenth of fifty callbacks. A poll takes some
milliseconds, in which it offers its core to others, see `CoreOffers`.

Log time is simulation time: the stamp in the header. For types without a header, and for
/diagnostics, whose publishers may not have received a tick yet, it is the last /clock published
before the message. Publish time is the publisher's wall clock. On hardware, without /clock, both
are wall time.

`/tf`, `/tf_static`, `/diagnostics` and `/rosout` have no namespace. The log of a vehicle in one
keeps the frames, status names and loggers of its namespace.
"""

import os
import time
from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import QoSHistoryPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rclpy.subscription import Subscription

from uam_lab.records.recording.bag import BagTopic, add_topic, write_metadata
from uam_lab.records.recording.bounded_log import BoundedLog
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.messages.serialized import deserialized, type_name
from uam_msgs_py.messages.tf_message import read_transforms, transforms_message
from uam_msgs_py.node.door import Door
from uam_msgs_py.node.namespace import expanded, prefix
from uam_msgs_py.node.rightful import RightfulNodes
from uam_msgs_py.node.sole_publisher import UNKNOWN, Taker, publishers

# a serialized message → the part to keep, None: nothing; raises BadMessage
Filter = Callable[[bytes], bytes | None]
DEPTH = 2000  # queue length per topic: 8 s at control rate
AT_ONCE = 4  # messages between two offers
LONG = 0.002  # [s] a tick's process computes for less than this


def own_part(topic: topics.Topic, namespace: str) -> Filter | None:
    """Return the filter of a topic for a vehicle; None where every message is its own."""
    own = prefix(namespace)
    chosen = {
        topics.TF: _frames,
        topics.TF_STATIC: _frames,
        topics.DIAGNOSTICS: _statuses,
        topics.ROSOUT: _lines,
    }.get(topic)
    return None if chosen is None or not own else lambda data: chosen(data, own)


def _frames(data: bytes, own: str) -> bytes | None:
    every = read_transforms(data)
    kept = [one for one in every if one.parent.startswith(own) or one.child.startswith(own)]
    if len(kept) == len(every):
        return data
    return transforms_message(kept) if kept else None


def _statuses(data: bytes, own: str) -> bytes | None:
    message = deserialized(data, DiagnosticArray)
    kept = [status for status in message.status if status.name.startswith(own)]
    if len(kept) == len(message.status):
        return data
    message.status = kept
    return serialize_message(message) if kept else None


def _lines(data: bytes, own: str) -> bytes | None:
    """Keep the lines of loggers such as `uav1.mission`."""
    return data if deserialized(data, Log).name.startswith(own.replace("/", ".")) else None


def begins_with_stamp(message_type: type) -> bool:
    """Return whether `stamp_of` applies to the message type."""
    fields = list(message_type.get_fields_and_field_types().items())
    return fields[0] in (("header", "std_msgs/Header"), ("clock", "builtin_interfaces/Time"))


@dataclass
class Track:
    """One recorded topic."""

    topic: str
    subscription: Subscription
    taker: Taker
    take: Callable[[], bytes | None]
    stamped: bool
    channel: int
    own: Filter | None
    read: Callable[[bytes], object] | None = None  # raises BadMessage for bytes that are none
    arrived: float | None = None  # time.monotonic() of the newest message
    last_sequences: dict[bytes, int] = field(default_factory=dict)  # by publisher
    lost: dict[str, int] = field(default_factory=dict)  # by the publisher's node


def _reader(topic: topics.Topic) -> Callable[[bytes], object]:
    """Return the check of messages that anyone may send: other programs will read the log."""
    if topic in (topics.TF, topics.TF_STATIC):
        return read_transforms
    return lambda data: deserialized(data, topic.type)


class CoreOffers:
    """Call `begin` at the begin of a poll, then `after` each message.

    A process that the flight waits for, and that becomes ready during a poll on the same core,
    often waits for its end: Linux lets a running process finish its slice. One that gives up the
    core waits for others in turn, on a busy computer for many milliseconds. So a poll offers
    nothing more after a long wait.
    """

    def __init__(self) -> None:
        self._offering = True

    def begin(self) -> None:
        """Begin a poll: offer again."""
        self._offering = True

    def after(self, number: int) -> None:
        """Offer the core if `number` messages are a multiple of AT_ONCE."""
        if number % AT_ONCE or not self._offering:
            return
        begun = time.perf_counter()
        os.sched_yield()
        self._offering = time.perf_counter() - begun < LONG


class TopicRecorder:
    """The open file, `log`, and its subscriptions."""

    def __init__(
        self,
        node: Node,
        file: Path,
        chosen: list[topics.Topic],
        simulated: bool,
        rightful: RightfulNodes,
        metadata: Mapping[str, Mapping[str, str]] | None = None,
        size_limit: float = 0.0,
    ):
        """Subscribe to `chosen` and create `file` with the named texts `metadata`.

        rightful: whose messages are written; size_limit [MB], 0 for none. Raises FileExistsError
        for an existing file, OSError.
        """
        self._simulated, self._namespace = simulated, node.get_namespace()
        self.log = BoundedLog(file, size_limit)
        for name, values in (metadata or {}).items():
            self.log.add_metadata(name, values)
        self._bag: list[BagTopic] = []
        self.door = Door(node)
        self._node, self._rightful = node, rightful
        self._offers = CoreOffers()
        self._tracks = [self._track(topic) for topic in chosen]
        # /clock is taken last in each poll: then every /clock published before any other message
        # of this poll is available
        self._tracks.sort(key=lambda track: track.topic == topics.CLOCK.name)
        self._clock_wall: list[int] = []  # publisher's wall clock of each /clock [ns]
        self._clock_sim: list[int] = []

    def _track(self, topic: topics.Topic) -> Track:
        qos = QoSProfile(
            history=QoSHistoryPolicy.KEEP_LAST,
            depth=DEPTH,
            reliability=topic.reading.reliability,
            durability=topic.qos.durability,
        )
        name = expanded(self._namespace, topic.name)
        self._bag.append(BagTopic(name, type_name(topic.type), topic.qos))
        channel = add_topic(self.log, self._bag[-1])
        stamped = begins_with_stamp(topic.type) and topic.one_publisher
        # a foreign message would be a row of the table
        subscription = self.door.listen(
            topic, qos, True, self._rightful, lambda: self._clock_sim != []
        )
        guard, taker = self.door.guards.get(subscription), self.door.taker(subscription)
        read, take = (_reader(topic), taker.take) if guard is None else (None, guard.take)
        own = own_part(topic, self._namespace)
        return Track(topic.name, subscription, taker, take, stamped, channel, own, read)

    def poll(self) -> int:
        """Write all received messages; return their number."""
        batch: list[tuple[Track, bytes, int, int, int | None]] = []
        now, offers = time.monotonic(), self._offers
        offers.begin()

        def keep(track: Track, data: bytes, published: int, sequence: int) -> None:
            """Note a message for the log; raises BadMessage."""
            if track.read is not None:
                track.read(data)
            stamp = stamp_of(data) if track.stamped or track.topic == topics.CLOCK.name else None
            if track.topic == topics.CLOCK.name:
                self._clock_wall.append(published)
                self._clock_sim.append(stamp)
            own = data if track.own is None else track.own(data)
            if own is not None:
                batch.append((track, own, published, sequence, stamp if track.stamped else None))
                track.arrived = now

        for track in self._tracks:
            taker, info = track.taker, track.taker.info
            while (data := track.take()) is not None:
                published = info.source_timestamp
                sequence = info.publication_sequence_number
                self._count_lost(track, bytes(taker.gid), sequence)
                self.door.accepts(track.subscription, keep, track, data, published, sequence)
                offers.after(len(batch))
        for number, (track, data, published, sequence, stamp) in enumerate(batch):
            offers.after(number)
            at = self._sim_time(published) if stamp is None else stamp
            self.log.write(track.channel, max(at, 0), published, data, sequence & 0xFFFFFFFF)
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

    def _count_lost(self, track: Track, gid: bytes, sequence: int) -> None:
        """Count the messages between two numbers of one publisher."""
        last = track.last_sequences.get(gid, 0)
        if 0 < last < sequence - 1:
            topic = track.subscription.topic_name
            name = publishers(self._node, topic).get(gid, UNKNOWN)
            track.lost[name] = track.lost.get(name, 0) + sequence - 1 - last
        track.last_sequences[gid] = sequence

    @property
    def inlets(self) -> dict[str, Subscription]:
        """The subscriptions by topic."""
        return {track.topic: track.subscription for track in self._tracks}

    @property
    def arrivals(self) -> dict[str, float]:
        """time.monotonic() of the newest message of each topic with messages."""
        return {t.topic: t.arrived for t in self._tracks if t.arrived is not None}

    @property
    def until(self) -> int:
        """Simulation time [ns] of the newest /clock, 0 before the first."""
        return self._clock_sim[-1] if self._clock_sim else 0

    @property
    def lost(self) -> dict[str, int]:
        """Number of lost messages, for topics with losses."""
        return {topic: sum(lost.values()) for topic, lost in self.lost_by_publisher.items()}

    @property
    def lost_by_publisher(self) -> dict[str, dict[str, int]]:
        """Number of lost messages, for topics with losses: topic → publisher's node → number."""
        lost = {track.topic: track.lost for track in self._tracks if track.lost}
        return {expanded(self._namespace, topic): counts for topic, counts in lost.items()}

    def close(self) -> bool:
        """Complete the file and write metadata.yaml beside it, see `bag.write_metadata`.

        Raises OSError if metadata.yaml cannot be written.
        """
        lost = {topic: str(count) for topic, count in self.lost.items()}
        self.log.add_metadata("lost messages", lost)
        self.log.close()
        return write_metadata(self.log, self._bag)
