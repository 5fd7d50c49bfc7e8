"""The topics of a log as rows by stamp and as messages; latencies and losses."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Self, TypeVar

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray

from uam_control.stamps import SECOND
from uam_lab.records.recording.mcap_reader import TopicLog, UnreadableLog, read_log
from uam_lab.records.results.result_folder import known_json
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import read_switch
from uam_msgs_py.messages.layouts import STAMP, BadMessage, Layout, Layouts
from uam_msgs_py.messages.serialized import deserialized, type_name
from uam_msgs_py.messages.status import MissionStatus
from uam_msgs_py.messages.topics import Topic
from uam_msgs_py.node.namespace import expanded
from uam_sim_bridge.nodes.plant_health import DEADLINE_TICKS

ADAPTATION = {
    "position": topics.POSITION_ADAPTATION,
    "attitude": topics.ATTITUDE_ADAPTATION,
    "arm": topics.ARM_ADAPTATION,
}
TOPICS = (
    *(topics.TRUTH_STATE, topics.TRUTH_PAYLOAD, topics.TRUTH_ROTORS, topics.TRUTH_MAGNET),
    *(topics.STATE, topics.REFERENCE, topics.MISSION_STATUS, topics.ARMING, topics.CHANGES),
    topics.FAULTS,
    *(topics.POSITION_COMMAND, topics.ATTITUDE_COMMAND, topics.ARM_COMMAND),
    *(topics.SETPOINT, topics.THRUST, topics.PAYLOAD, *ADAPTATION.values()),
)
RECORDER = "recorder.json"
LABORATORY_FILE = "laboratory.json"


@dataclass
class Block:
    """Messages with one layout."""

    order: np.ndarray  # (m,) numbers of the messages within the topic
    stamps: np.ndarray  # (m,) [ns]
    names: list[str]
    fields: dict[str, np.ndarray]  # each (m, n) float64; time_from_start: int64 [ns]


def read_blocks(type_name: str, messages: Sequence[bytes]) -> list[Block]:
    """Decode all messages of one topic; return one block per layout.

    Raises KeyError for a type without a layout, BadMessage for an invalid message.
    """
    layouts = Layouts(type_name)
    groups: dict[int, tuple[Layout, list[int]]] = {}
    for number, data in enumerate(messages):
        layout = layouts.of(data)
        groups.setdefault(id(layout), (layout, []))[1].append(number)
    return [_block(layout, messages, np.array(numbers)) for layout, numbers in groups.values()]


def _block(layout: Layout, messages: Sequence[bytes], numbers: np.ndarray) -> Block:
    table = np.frombuffer(b"".join([messages[i] for i in numbers]), dtype=np.uint8)
    table = table.reshape(len(numbers), -1)
    fields = {
        name: np.ascontiguousarray(table[:, where]).view("<f8")
        for name, where in layout.fields.items()
    }
    if layout.duration is not None:
        fields["time_from_start"] = _nanoseconds(table[:, layout.duration])
    return Block(numbers, _nanoseconds(table[:, STAMP]), layout.names, fields)


def _nanoseconds(table: np.ndarray) -> np.ndarray:
    """Convert int32 seconds and uint32 nanoseconds, bytes (m, 8), to int64 (m,) [ns]."""
    pairs = np.ascontiguousarray(table).view([("sec", "<i4"), ("nanosec", "<u4")])[:, 0]
    return pairs["sec"].astype(np.int64) * 1_000_000_000 + pairs["nanosec"]


T = TypeVar("T")


class StampedRows:
    """Values of one topic, sorted by stamp: stamps (m,) [ns], rows (m, n)."""

    def __init__(self, stamps: np.ndarray, rows: np.ndarray):
        order = np.argsort(stamps, kind="stable")
        self.stamps, self.rows = stamps[order], rows[order]

    def at(self, ticks: np.ndarray) -> np.ndarray:
        """Return the rows (k, n) at the stamps ticks (k,) [ns] or last before them; else NaN."""
        out = np.full((len(ticks), self.rows.shape[1]), np.nan)
        if not len(self.stamps):
            return out
        index = np.searchsorted(self.stamps, ticks, side="right") - 1
        there = index >= 0
        out[there] = self.rows[index[there]]
        return out


class Log:
    """The topics of one vehicle in a log, decoded on request.

    found: by name; namespace: of the vehicle's nodes; notes: lines about what cannot be read;
    name: of the log in errors.
    """

    def __init__(
        self,
        found: Mapping[str, TopicLog],
        namespace: str = "/",
        notes: Sequence[str] = (),
        name: str = "the log",
    ):
        self.notes, self.name = [*notes], name
        self._topics = {
            topic: found[name]
            for topic in TOPICS
            if (name := expanded(namespace, topic.name)) in found
        }
        self._blocks: dict[Topic, list[Block]] = {}

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a log; its namespace is that of the states' topics.

        Raises UnreadableLog, also for a log of several vehicles; OSError.
        """
        ends = tuple(f"/{topic.name}" for topic in TOPICS)
        notes: list[str] = []
        found = read_log(path, lambda name: name.endswith(ends), notes.append)
        states = tuple(f"/{topic.name}" for topic in (topics.TRUTH_STATE, topics.STATE))
        spaces = {name.removesuffix(one) for name in found for one in states if name.endswith(one)}
        if len(spaces) > 1:
            raise UnreadableLog(f"{path} has several vehicles: {', '.join(sorted(spaces))}")
        return cls(found, spaces.pop() if spaces else "/", notes, str(path))

    def messages(self, topic: Topic) -> list[bytes]:
        """Return the serialized messages of a topic in file order; may be empty."""
        log = self._topics.get(topic)
        return log.messages if log else []

    def width(self, topic: Topic) -> int:
        """Number of names in the messages of a topic; 0 without messages."""
        return next((len(block.names) for block in self.blocks(topic)), 0)

    def wall_seconds(self, topic: Topic) -> float:
        """Return the wall time between first and last message of a topic [s]; 0 without any."""
        log = self._topics.get(topic)
        return (max(log.published) - min(log.published)) / SECOND if log and log.published else 0.0

    def published(self, topic: Topic) -> tuple[np.ndarray, np.ndarray]:
        """Return stamps (m,) [ns] and wall times of publication (m,) [ns] of a topic's messages."""
        log, blocks = self._topics.get(topic), self.blocks(topic)
        if log is None or not blocks:
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        stamps = np.concatenate([one.stamps for one in blocks])
        order = np.concatenate([one.order for one in blocks])  # of two layouts they come mixed
        return stamps, np.array(log.published)[order]

    def blocks(self, topic: Topic) -> list[Block]:
        """Return the messages of a topic, decoded once; may be empty. Raises UnreadableLog."""
        made = self._blocks.get(topic)
        if made is None:
            made = self._blocks[topic] = self._decoded(topic)
        return made

    def _decoded(self, topic: Topic) -> list[Block]:
        log, needed = self._topics.get(topic), type_name(topic.type)
        if log is None or not log.messages:
            return []
        if log.type_name != needed:
            raise UnreadableLog(
                f"{self.name}: {topic.name} has the type {log.type_name} in place of {needed}: "
                "this is no log of this program, or of another version"
            )
        try:
            return read_blocks(log.type_name, log.messages)
        except BadMessage as error:
            raise UnreadableLog(
                f"{self.name}: a message of {topic.name} is damaged: {error}"
            ) from None

    def samples(self, topic: Topic, fields: Sequence[str], width: int) -> StampedRows:
        """Return `fields` side by side, `width` numbers each; zeros for empty (idle) messages."""
        stamps, rows = [], []
        for block in self.blocks(topic):
            stamps.append(block.stamps)
            rows.append(np.hstack([_field(block, field, width) for field in fields]))
        if not stamps:
            return StampedRows(np.zeros(0, np.int64), np.zeros((0, width * len(fields))))
        return StampedRows(np.concatenate(stamps), np.vstack(rows))

    @property
    def arming_commanded(self) -> bool:
        """Whether the mission asked for arming; True also for a log without its commands."""
        commands = self.messages(topics.ARMING)
        return not commands or any(map(read_switch, commands))

    def statuses(self) -> list[tuple[int, MissionStatus]]:
        """Return stamps [ns] and statuses of the mission, in order."""
        return self.diagnostics(topics.MISSION_STATUS, MissionStatus.from_message)

    def diagnostics(self, topic: Topic, decode: Callable[[DiagnosticArray], T]) -> list[T]:
        """Return the decoded messages of a topic of DiagnosticArray, in order.

        Those that raise BadMessage are left out, with a note: anyone may have sent them.
        """
        found, logged = [], self.messages(topic)
        for data in logged:
            with suppress(BadMessage):
                found.append(decode(deserialized(data, DiagnosticArray)))
        if missing := len(logged) - len(found):
            self.notes.append(f"{topic.name}: {missing} messages cannot be read; left out")
        return found


def _field(block: Block, field: str, width: int) -> np.ndarray:
    found = block.fields.get(field)
    if found is None:
        return np.zeros((len(block.stamps), width))
    return found[:, :width]


def latencies(log: Log, period: float, ticks: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the times (m,) [s] from the IMU's samples to the sending of their setpoints.

    And the number of missed ticks, sent later than DEADLINE_TICKS periods [s] or never. ticks (k,)
    [ns]: those that count. A tick has the stamp of its sample; stamps and wall times are those of
    the same computer.
    """
    stamps, sent = log.published(topics.SETPOINT)
    counts = np.isin(stamps, ticks)
    latency = (sent - stamps)[counts] / SECOND
    in_time = stamps[counts][latency <= DEADLINE_TICKS * period]
    return latency, len(np.setdiff1d(ticks, in_time))


def losses(logs: Path) -> list[str]:
    """Return a note about the messages that the recorder lost, in a list; [] if it lost none."""
    lost = known_json(logs / RECORDER).get("lost")
    if not lost:
        return []
    text = ", ".join(f"{count} of {topic}" for topic, count in lost.items())
    buffers = "uam doctor checks the receive buffers"
    return [f"the recorder lost {sum(lost.values())} messages, {buffers}: {text}"]
