"""Terminal, pipe or file that the commands print to: what is wrong with it ends no flight."""

import errno
import os
import sys
from typing import Any, TextIO


class Output:
    """A text stream of this process whose lines may get lost: without a reader, or without room.

    From the first error on its lines go nowhere. Other members are the stream's.
    """

    lost: str | None = None  # reason of that error, "" for a reader that ended: `uam fly | head`

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        stream.reconfigure(errors="replace")  # an encoding may lack a letter

    def write(self, text: str) -> int:
        try:
            return self._stream.write(text)
        except OSError as error:
            self._lose(error)
            return len(text)

    def flush(self) -> None:
        """Hand over what is written."""
        try:
            self._stream.flush()
        except OSError as error:
            self._lose(error)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _lose(self, error: OSError) -> None:
        self.lost = "" if error.errno == errno.EPIPE else (error.strerror or str(error)).lower()
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self._stream.fileno())
        os.close(nowhere)


def begin() -> None:
    """Let the streams of this process be of this kind; one that was closed stays None."""
    for name in ("stdout", "stderr"):
        if (stream := getattr(sys, name)) is not None:
            setattr(sys, name, Output(stream))


def reason() -> str:
    """Return why lines of stdout are missing, "" if nothing is wrong, or nobody reads them."""
    if sys.stdout is not None:
        sys.stdout.flush()
    return getattr(sys.stdout, "lost", None) or ""
