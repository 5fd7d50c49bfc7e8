"""Reads an MCAP log in one pass, also without an index (after a kill of the recorder)."""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from mcap.exceptions import EndOfFile
from mcap.records import Channel, DataEnd, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import MAGIC_SIZE, StreamReader
from mcap.writer import MCAP0_MAGIC


class UnreadableLog(ValueError):
    """The file is no readable MCAP file; the text is one line."""


@dataclass
class TopicLog:
    """Messages of one topic in file order: log times [ns], serialized messages, wall times [ns]."""

    type_name: str
    times: list[int] = field(default_factory=list)
    messages: list[bytes] = field(default_factory=list)
    published: list[int] = field(default_factory=list)


def read_log(path: Path, chosen: Callable[[str], bool] = lambda _: True) -> dict[str, TopicLog]:
    """Return all messages of the topics for whose names `chosen` is true, by topic.

    An incomplete last record is ignored. Raises UnreadableLog, OSError.
    """
    found: dict[str, TopicLog] = {}
    types: dict[int, str] = {}  # schema id → type name
    logs: dict[int, TopicLog] = {}  # channel id → its topic's messages
    for record in _records(path):
        if isinstance(record, Message):
            log = logs.get(record.channel_id)
            if log is not None:
                log.times.append(record.log_time)
                log.published.append(record.publish_time)
                log.messages.append(record.data)
        elif isinstance(record, Schema):
            types[record.id] = record.name
        elif isinstance(record, Channel) and chosen(record.topic):
            log = TopicLog(types[record.schema_id])
            logs[record.id] = found.setdefault(record.topic, log)
    return found


def read_metadata(path: Path) -> dict[str, dict[str, str]]:
    """Return the metadata of a log, also of a truncated one. Raises UnreadableLog, OSError."""
    records = _records(path, emit_chunks=True)
    return {record.name: record.metadata for record in records if isinstance(record, Metadata)}


def _records(path: Path, emit_chunks: bool = False) -> Iterator[McapRecord]:
    """Yield the complete records before the index; emit_chunks: do not unpack chunks."""
    with path.open("rb") as stream:
        if stream.read(MAGIC_SIZE) != MCAP0_MAGIC:  # a shorter file, too
            raise UnreadableLog(f"{path} is not an MCAP file")
        stream.seek(0)
        try:
            for record in StreamReader(stream, emit_chunks=emit_chunks).records:
                if isinstance(record, DataEnd):
                    return
                yield record
        except (EndOfFile, struct.error):  # the log was cut off here
            return
