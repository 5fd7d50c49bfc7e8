"""A log that ends before the disk does: at a size, or when nothing more can be written.

What was written until then stays; whoever records goes on without it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from uam_lab.recording.mcap_writer import McapWriter

MEGABYTE = 1_000_000


class BoundedLog:
    """An `McapWriter` with an end. ended: why nothing is written any more, "" while it is."""

    def __init__(self, file: Path, limit: float) -> None:
        """limit [MB], 0 for none. Raises OSError where the file cannot be created."""
        self.ended = ""
        self._writer = McapWriter(file)
        self._limit = limit * MEGABYTE
        self.add_channel = self._writer.add_channel

    @property
    def counts(self) -> dict[str, int]:
        """Messages written, per topic."""
        return self._writer.counts

    def write(
        self, channel: int, log_time: int, publish_time: int, data: bytes, sequence: int
    ) -> None:
        """Append a message, see `McapWriter.write`."""
        if not self.ended:
            self._try(partial(self._writer.write, channel, log_time, publish_time, data, sequence))

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add named text values to the file."""
        if not self.ended:
            self._try(partial(self._writer.add_metadata, name, dict(values)))

    def flush(self) -> None:
        """Bring what was written to the file, and end it where it has become too long."""
        if self.ended:
            return
        self._try(self._writer.flush)
        if not self.ended and 0 < self._limit <= self._writer.size:
            self._try(self._writer.close)
            self.ended = (
                self.ended or f"the log has its largest size, {self._limit / MEGABYTE:g} MB"
            )

    def close(self) -> None:
        """Index and end the file."""
        if not self.ended:
            self._try(self._writer.close)

    def _try(self, action: Callable[[], object]) -> None:
        try:
            action()
        except OSError as error:
            self.ended = f"the log cannot be written: {error.strerror or error}"
