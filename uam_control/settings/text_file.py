"""Text files that people give: UTF-8 in every locale, with a byte order mark or without."""

from __future__ import annotations

from pathlib import Path


def text_of(file: Path, error: type[ValueError]) -> str:
    """Return the content of a file, line ends as \\n; raise `error` with one line."""
    try:
        return file.read_text(encoding="utf-8-sig")
    except OSError as reason:
        raise error(f"{file}: {reason.strerror or reason}") from None
    except UnicodeDecodeError as reason:
        raise error(f"{file}: not a text in UTF-8 (byte {reason.start + 1})") from None
