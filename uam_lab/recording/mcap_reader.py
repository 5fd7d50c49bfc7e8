"""Reads an MCAP log in one pass, also one whose recorder was killed before it wrote the index."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Metadata, Schema

from uam_lab.recording.mcap_writer import MAGIC, MESSAGE

RECORD = struct.Struct("<BQ")  # opcode, length


class UnreadableLog(ValueError):
    """Not an MCAP file that can be read here; the text is one line."""


@dataclass
class TopicLog:
    """Messages of one topic in file order: log times [ns], serialized messages, wall times [ns]."""

    type_name: str
    times: list[int] = field(default_factory=list)
    messages: list[bytes] = field(default_factory=list)
    published: list[int] = field(default_factory=list)


def read_log(path: Path, topics: set[str] | None = None) -> dict[str, TopicLog]:
    """All messages of `topics` (default: every one), by topic.

    What follows the last complete record is ignored. Raises UnreadableLog, or OSError.
    """
    data = path.read_bytes()
    if not data.startswith(MAGIC):
        raise UnreadableLog(f"{path} is not an MCAP file")
    reader = _Pass(topics)
    for opcode, body in _records(memoryview(data)[len(MAGIC) :]):
        if opcode == Opcode.CHUNK:
            chunk = Chunk.read(_stream(body))
            for inner, content in _records(memoryview(_uncompressed(path, chunk))):
                reader.take(inner, content)
        elif opcode == Opcode.DATA_END:
            break
        else:
            reader.take(opcode, body)
    return reader.found


def read_metadata(path: Path) -> dict[str, dict[str, str]]:
    """The named texts of a log, also of one that was cut off. Raises UnreadableLog, or OSError."""
    data = path.read_bytes()
    if not data.startswith(MAGIC):
        raise UnreadableLog(f"{path} is not an MCAP file")
    found = {}
    for opcode, body in _records(memoryview(data)[len(MAGIC) :]):
        if opcode == Opcode.METADATA:
            record = Metadata.read(_stream(body))
            found[record.name] = record.metadata
        elif opcode == Opcode.DATA_END:
            break
    return found


class _Pass:
    def __init__(self, topics: set[str] | None):
        self.found: dict[str, TopicLog] = {}
        self._topics = topics
        self._schemas: dict[int, str] = {}
        self._logs: dict[int, TopicLog] = {}

    def take(self, opcode: int, body: memoryview) -> None:
        if opcode == Opcode.MESSAGE:
            channel, _, time, published = _MESSAGE_BODY.unpack_from(body)
            log = self._logs.get(channel)
            if log is not None:
                log.times.append(time)
                log.published.append(published)
                log.messages.append(bytes(body[_MESSAGE_BODY.size :]))
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(_stream(body))
            self._schemas[schema.id] = schema.name
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(_stream(body))
            if self._topics is None or channel.topic in self._topics:
                name = self._schemas[channel.schema_id]
                self._logs[channel.id] = self.found.setdefault(channel.topic, TopicLog(name))


_MESSAGE_BODY = struct.Struct("<" + MESSAGE.format.removeprefix("<BQ"))


def _records(data: memoryview) -> Iterator[tuple[int, memoryview]]:
    """The complete records of a stretch of the file: (opcode, content)."""
    at = 0
    while at + RECORD.size <= len(data):
        opcode, length = RECORD.unpack_from(data, at)
        at += RECORD.size
        if at + length > len(data):
            return
        yield opcode, data[at : at + length]
        at += length


def _stream(body: memoryview) -> ReadDataStream:
    return ReadDataStream(BytesIO(body))


def _uncompressed(path: Path, chunk: Chunk) -> bytes:
    if chunk.compression == "":
        return chunk.data
    if chunk.compression != "zstd":
        raise UnreadableLog(f"{path}: chunks compressed with {chunk.compression} are not read here")
    return zstandard.ZstdDecompressor().decompress(chunk.data, chunk.uncompressed_size)
