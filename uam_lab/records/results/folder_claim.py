"""A folder belongs to one flight or one campaign while it writes; death of the process frees it."""

from __future__ import annotations

import fcntl
import os
import weakref
from pathlib import Path

_of_process: dict[Path, FolderClaim] = {}  # claims of commands, to the end of this process


class ResultFolderError(ValueError):
    """The result folder cannot be used; the text is one line."""


class FolderClaim:
    """A lock (flock) of the folder itself, which needs no file. Ends with this object."""

    def __init__(self, path: Path) -> None:
        """Raises ResultFolderError, OSError. A file system without such locks has none."""
        opened = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        self.release = weakref.finalize(self, os.close, opened)
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.release()
            raise ResultFolderError(
                f"result folder {path} is in use: another flight or campaign writes to it; wait "
                "for its end, or give another --out"
            ) from None
        except OSError:
            self.release()


def claim(path: Path) -> FolderClaim:
    """Return a claim of the folder, that of this process if it has one."""
    return _of_process.get(path.resolve()) or FolderClaim(path)


def claim_for_process(path: Path) -> None:
    """Claim the folder to the end of this process; again is allowed."""
    _of_process[path.resolve()] = claim(path)
