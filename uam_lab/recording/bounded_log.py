"""Writes ROS messages, already serialized, to an MCAP file that ends before the disk does.

The log ends at a size, or when nothing more can be written. What was written until then stays, and
the recorder goes on without it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from mcap.writer import Writer

MEGABYTE = 1_000_000


class BoundedLog:
    """One MCAP file with profile `ros2`. Not thread-safe.

    ended: why nothing is written any more, "" while the log is open. counts: messages per topic.
    """

    def __init__(self, file: Path, limit: float) -> None:
        """Create the file, replacing an existing one. limit [MB], 0 for none.

        Raises OSError where the file cannot be created.
        """
        self.ended = ""
        self.counts: Counter[str] = Counter()
        self._file = file.open("wb")
        self._limit = limit * MEGABYTE
        self._schemas: dict[str, int] = {}  # type name → schema id
        self._topics: dict[int, str] = {}  # channel id → topic
        self._writer = Writer(self._file)
        self._writer.start(profile="ros2", library="uam recorder")

    def add_channel(
        self, topic: str, type_name: str, schema: str, metadata: Mapping[str, str]
    ) -> int:
        """Announce a topic of `package/msg/Name` with its `ros2msg` schema; returns its id."""
        if type_name not in self._schemas:
            schema_id = self._writer.register_schema(type_name, "ros2msg", schema.encode())
            self._schemas[type_name] = schema_id
        channel = self._writer.register_channel(
            topic, "cdr", self._schemas[type_name], dict(metadata)
        )
        self._topics[channel] = topic
        self.counts[topic] = 0
        return channel

    def write(
        self, channel: int, log_time: int, publish_time: int, data: bytes, sequence: int
    ) -> None:
        """Append a CDR message; times in nanoseconds, not negative."""
        if not self.ended:
            add = self._writer.add_message
            self._try(add, channel, log_time, data, publish_time, sequence)
            self.counts[self._topics[channel]] += 1

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add named text values to the file."""
        if not self.ended:
            self._try(self._writer.add_metadata, name, dict(values))

    def flush(self) -> None:
        """Bring what was written to the file, so that a killed recorder loses nothing of it.

        Ends the log where the file has become too long.
        """
        if self.ended:
            return
        self._try(self._writer.flush)
        if not self.ended and 0 < self._limit <= self._file.tell():
            self.close()
            self.ended = (
                self.ended or f"the log has its largest size, {self._limit / MEGABYTE:g} MB"
            )

    def close(self) -> None:
        """Write the index and end the file. Calling it again does nothing."""
        if not self.ended and not self._file.closed:
            self._try(self._writer.finish)
            self._try(self._file.close)

    def _try(self, action: Callable[..., object], *arguments: Any) -> None:
        try:
            action(*arguments)
        except OSError as error:
            self.ended = f"the log cannot be written: {error.strerror or error}"
