"""Reads an MCAP log in one pass, also without an index (after a kill of the recorder).

Records are told apart here, by struct: the reader of the library makes an object of each message
and of each entry of the index, which takes five times as long. Chunks, channels, schemas and
metadata are read by the library. Layout of the records: the MCAP specification, "Records".
"""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Metadata, Schema
from mcap.stream_reader import MAGIC_SIZE, get_chunk_data_stream, zstandard
from mcap.writer import MCAP0_MAGIC

HEADER = struct.Struct("<BQ")  # opcode, length of the content [bytes]
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time [ns], publish time [ns]
# of a record that was cut off or changed; ValueError: a wrong checksum, KeyError: its type is lost
DAMAGE = (EndOfFile, struct.error, ValueError, KeyError, zstandard.ZstdError)


class UnreadableLog(ValueError):
    """The file is no readable MCAP file; the text is one line."""


@dataclass
class TopicLog:
    """Messages of one topic in file order: log times [ns], serialized messages, wall times [ns]."""

    type_name: str
    times: list[int] = field(default_factory=list)
    messages: list[bytes] = field(default_factory=list)
    published: list[int] = field(default_factory=list)


def read_log(
    path: Path,
    chosen: Callable[[str], bool] = lambda _: True,
    note: Callable[[str], None] = lambda text: None,
) -> dict[str, TopicLog]:
    """Return all messages of the topics for whose names `chosen` is true, by topic.

    An incomplete last record is ignored, a damaged one is left out; note: called with a line that
    says so. Raises UnreadableLog, also if the damage leaves no topic; OSError.
    """
    topics, damaged = _Topics(chosen), 0
    for opcode, content in _records(path):
        try:
            if opcode == Opcode.CHUNK:
                chunk = Chunk.read(_stream(content))
                stream, length = get_chunk_data_stream(chunk, validate_crc=True)
                topics.read(stream.read(length))
            else:
                topics.read_one(opcode, content, 0, len(content))
        except DAMAGE:
            damaged += 1
    if damaged:
        text = f"{path.name} is damaged: {damaged} of its records cannot be read"
        if not topics.found:
            raise UnreadableLog(f"{path}: {text}")
        note(f"{text}, their messages are missing")
    return topics.found


class _Topics:
    """Collects the messages of the chosen topics in `found`."""

    def __init__(self, chosen: Callable[[str], bool]) -> None:
        self.found: dict[str, TopicLog] = {}
        self._chosen = chosen
        self._types: dict[int, str] = {}  # schema id → type name
        self._logs: dict[int, TopicLog] = {}  # channel id → its topic's messages

    def read(self, records: bytes) -> None:
        at, end = 0, len(records)
        while at < end:
            opcode, length = HEADER.unpack_from(records, at)
            at += HEADER.size
            self.read_one(opcode, records, at, at + length)
            at += length

    def read_one(self, opcode: int, data: bytes, begin: int, end: int) -> None:
        """Take the record with the content data[begin:end]."""
        if opcode == Opcode.MESSAGE:
            channel, _, logged, published = MESSAGE.unpack_from(data, begin)
            log = self._logs.get(channel)
            if log is not None:
                log.times.append(logged)
                log.published.append(published)
                log.messages.append(data[begin + MESSAGE.size : end])
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(_stream(data[begin:end]))
            self._types[schema.id] = schema.name
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(_stream(data[begin:end]))
            if self._chosen(channel.topic):
                log = TopicLog(self._types[channel.schema_id])
                self._logs[channel.id] = self.found.setdefault(channel.topic, log)


def read_metadata(path: Path) -> dict[str, dict[str, str]]:
    """Return the metadata of a log, also of a truncated one. Raises UnreadableLog, OSError."""
    records = (
        Metadata.read(_stream(content))
        for opcode, content in _records(path)
        if opcode == Opcode.METADATA
    )
    return {record.name: record.metadata for record in records}


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))


def _records(path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of the complete records before the index of the file."""
    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(MAGIC_SIZE) != MCAP0_MAGIC:  # a shorter file, too
            raise UnreadableLog(f"{path} is not an MCAP file")
        while len(header := file.read(HEADER.size)) == HEADER.size:
            opcode, length = HEADER.unpack(header)
            if opcode == Opcode.DATA_END:
                return
            if length > size - file.tell():  # the log was cut off here
                return
            yield opcode, file.read(length)
