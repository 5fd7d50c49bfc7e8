"""Writes serialized ROS messages to an MCAP file of limited size.

The log ends at its size limit or after a write error. The messages before that stay readable, and
the recorder continues without the log.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from mcap.writer import Writer

MEGABYTE = 1_000_000


class BoundedLog:
    """One MCAP file with profile `ros2`. Not thread-safe."""

    def __init__(self, file: Path, limit: float) -> None:
        """Create the file and its folder. limit [MB], 0 for none.

        Raises FileExistsError for an existing file, OSError if the file cannot be created.
        """
        self.ended = ""  # reason of the end of the log, "" while it is open
        self.counts: Counter[str] = Counter()  # messages per topic
        self.begin = self.end = 0  # [ns] least and largest log time, 0 without messages
        self._written = False
        self.file = file
        file.parent.mkdir(parents=True, exist_ok=True)
        self._file = file.open("wb" if file.is_char_device() else "xb")
        self._limit = limit * MEGABYTE
        self._schemas: dict[str, int] = {}  # type name → schema id
        self._topics: dict[int, str] = {}  # channel id → topic
        self._writer = Writer(self._file)
        self._writer.start(profile="ros2", library="uam recorder")

    def add_channel(
        self, topic: str, type_name: str, schema: str, metadata: Mapping[str, str]
    ) -> int:
        """Register a topic of type `package/msg/Name` with its `ros2msg` schema; return its id."""
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
        """Append a CDR message; times in nanoseconds, 0 or more."""
        if not self.ended:
            add = self._writer.add_message
            self._try(add, channel, log_time, data, publish_time, sequence)
            if self.ended:
                return
            self.counts[self._topics[channel]] += 1
            self.begin = min(self.begin, log_time) if self._written else log_time
            self.end = max(self.end, log_time)
            self._written = True

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add named text values to the file."""
        if not self.ended:
            self._try(self._writer.add_metadata, name, dict(values))

    def flush(self) -> None:
        """Write buffered messages to the file, so that they survive a kill of the recorder.

        Ends the log if the file has reached its size limit.
        """
        if self.ended:
            return
        self._try(self._writer.flush)
        if not self.ended and 0 < self._limit <= self._file.tell():
            self.close()
            self.ended = (
                self.ended or f"the log reached its size limit, {self._limit / MEGABYTE:g} MB"
            )

    def close(self) -> None:
        """Write the index and close the file. A second call has no effect."""
        if not self.ended and not self._file.closed:
            self._try(self._writer.finish)
            self._try(self._file.close)

    def _try(self, action: Callable[..., object], *arguments: Any) -> None:
        try:
            action(*arguments)
        except OSError as error:
            self.ended = f"the log cannot be written: {error.strerror or error}"
