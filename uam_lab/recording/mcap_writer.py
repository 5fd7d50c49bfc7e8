"""Writes ROS messages, already serialized, to an MCAP file (https://mcap.dev/spec).

The writer of the public `mcap` package decides by size when a chunk goes to disk. A flight log must
reach the disk by time, so that little is lost when the recorder is killed; and the recorder takes
some 4000 messages a second. So chunks and messages are packed here, the rare records by `mcap`.
"""

import struct
import zlib
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

MAGIC = b"\x89MCAP0\r\n"
CHUNK_BYTES = 1 << 20  # a chunk is closed at this size at the latest
# opcode, record length; channel id, sequence, log time [ns], publish time [ns]
MESSAGE = struct.Struct("<BQHIQQ")
MESSAGE_FIELDS = MESSAGE.size - 9
FOOTER_FIELDS = struct.Struct("<BQQQ")


class McapWriter:
    """One MCAP file with profile `ros2`. Not thread-safe."""

    def __init__(self, path: Path, library: str = "uam recorder"):
        """Create the file, replacing an existing one."""
        self._file: BinaryIO = path.open("wb")
        self._compressor = zstandard.ZstdCompressor(level=1)
        self._schemas: dict[str, Schema] = {}
        self._channels: list[Channel] = []
        self._counts: dict[int, int] = {}
        self._chunk_indexes: list[ChunkIndex] = []
        self._metadata_indexes: list[MetadataIndex] = []
        self._times: tuple[int, int] | None = None  # first and last log time of the file
        self._new_chunk()
        self._file.write(MAGIC)
        self._record(Header(profile="ros2", library=library))

    def add_channel(self, topic: str, type_name: str, schema: str, metadata: dict[str, str]) -> int:
        """Announce a topic of `package/msg/Name` with its `ros2msg` schema; returns its id."""
        if type_name not in self._schemas:
            record = Schema(
                id=len(self._schemas) + 1, name=type_name, encoding="ros2msg", data=schema.encode()
            )
            self._schemas[type_name] = record
            self._chunk += _packed(record)
        channel = Channel(
            id=len(self._channels) + 1,
            schema_id=self._schemas[type_name].id,
            topic=topic,
            message_encoding="cdr",
            metadata=metadata,
        )
        self._channels.append(channel)
        self._counts[channel.id] = 0
        self._chunk += _packed(channel)
        return channel.id

    def write(
        self, channel: int, log_time: int, publish_time: int, data: bytes, sequence: int = 0
    ) -> None:
        """Append a CDR message; times in nanoseconds, not negative."""
        entry = (log_time, len(self._chunk))
        self._index.setdefault(channel, []).append(entry)
        self._chunk += MESSAGE.pack(
            Opcode.MESSAGE, MESSAGE_FIELDS + len(data), channel, sequence, log_time, publish_time
        )
        self._chunk += data
        if len(self._chunk) >= CHUNK_BYTES:
            self.flush()

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Add named text values to the file."""
        record = Metadata(name=name, metadata=values)
        offset = self._file.tell()
        length = self._record(record)
        self._metadata_indexes.append(MetadataIndex(offset=offset, length=length, name=name))

    def flush(self) -> None:
        """Bring everything written so far to the file, so that a killed recorder loses nothing."""
        if not self._chunk:
            return
        times = [entry[0] for entries in self._index.values() for entry in entries]
        first, last = (min(times), max(times)) if times else (0, 0)
        data = self._compressor.compress(bytes(self._chunk))
        chunk = Chunk(
            compression="zstd",
            data=data,
            message_start_time=first,
            message_end_time=last,
            uncompressed_crc=zlib.crc32(self._chunk),
            uncompressed_size=len(self._chunk),
        )
        start = self._file.tell()
        length = self._record(chunk)
        index_start, offsets = self._file.tell(), {}
        for channel, entries in self._index.items():
            offsets[channel] = self._file.tell()
            self._counts[channel] += len(entries)
            self._record(MessageIndex(channel_id=channel, records=entries))
        self._chunk_indexes.append(
            ChunkIndex(
                chunk_length=length,
                chunk_start_offset=start,
                compression="zstd",
                compressed_size=len(data),
                message_end_time=last,
                message_index_length=self._file.tell() - index_start,
                message_index_offsets=offsets,
                message_start_time=first,
                uncompressed_size=len(self._chunk),
            )
        )
        if times:
            known = self._times or (first, last)
            self._times = (min(known[0], first), max(known[1], last))
        self._new_chunk()
        self._file.flush()

    def close(self) -> None:
        """Write the index and end the file. Calling it again does nothing."""
        if self._file.closed:
            return
        self.flush()
        self._record(DataEnd(data_section_crc=0))  # 0: not computed
        start = self._file.tell()
        summary, offsets = bytearray(), bytearray()
        for opcode, records in self._summary():
            group = b"".join(map(_packed, records))
            if group:
                offset = SummaryOffset(
                    group_opcode=opcode, group_start=start + len(summary), group_length=len(group)
                )
                offsets += _packed(offset)
                summary += group
        offset_start = start + len(summary)
        summary += offsets
        footer = FOOTER_FIELDS.pack(Opcode.FOOTER, 8 + 8 + 4, start, offset_start)
        self._file.write(summary)
        crc = zlib.crc32(footer, zlib.crc32(summary))
        footer_record = Footer(
            summary_start=start, summary_offset_start=offset_start, summary_crc=crc
        )
        self._record(footer_record)
        self._file.write(MAGIC)
        self._file.close()

    @property
    def size(self) -> int:
        """Bytes in the file so far."""
        return self._file.tell()

    @property
    def counts(self) -> dict[str, int]:
        """Messages written per topic, including those not flushed yet."""
        waiting = {channel: len(entries) for channel, entries in self._index.items()}
        return {c.topic: self._counts[c.id] + waiting.get(c.id, 0) for c in self._channels}

    def _summary(self) -> list[tuple[Opcode, list]]:
        first, last = self._times or (0, 0)
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunk_indexes),
            message_count=sum(self._counts.values()),
            message_end_time=last,
            message_start_time=first,
            metadata_count=len(self._metadata_indexes),
            schema_count=len(self._schemas),
        )
        return [
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._chunk_indexes),
            (Opcode.METADATA_INDEX, self._metadata_indexes),
        ]

    def _new_chunk(self) -> None:
        self._chunk = bytearray()
        self._index: dict[int, list[tuple[int, int]]] = {}

    def _record(self, record: McapRecord) -> int:
        """Write a record to the file; returns its length in bytes."""
        return self._file.write(_packed(record))

    def __enter__(self) -> "McapWriter":
        return self

    def __exit__(self, *exception) -> None:
        self.close()


def _packed(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
