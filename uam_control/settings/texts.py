"""Texts: files that people give, words about an unknown name, foreign text made visible."""

import re
from collections.abc import Collection
from difflib import get_close_matches
from pathlib import Path

# C0 without the tab, DEL, C1; separators of lines; marks that turn the direction of reading
OBEYED = re.compile(
    r"[\x00-\x08\x0a-\x1f\x7f-\x9f\u2028\u2029\u200e\u200f\u202a-\u202e\u2066-\u2069]"
)
SHORT = 12  # names of a list that is always shown


def visible(text: object) -> str:
    """Return `text` in one line, with the picture of each control character in its place.

    "\\x1b" becomes "␛", a newline "␊"; characters without a picture become "�".
    """
    return OBEYED.sub(_picture, str(text))


def _picture(found: re.Match[str]) -> str:
    code = ord(found[0])
    return chr(0x2400 + code) if code < 0x20 else "␡" if code == 0x7F else "�"


def text_of(file: Path, error: type[ValueError]) -> str:
    """Return the content of a file, line ends as \\n; raise `error` with one line."""
    try:
        return file.read_text(encoding="utf-8-sig")
    except OSError as reason:
        raise error(f"{file}: {reason.strerror or reason}") from None
    except UnicodeDecodeError as reason:
        raise error(f"{file}: not a text in UTF-8 (byte {reason.start + 1})") from None


def unknown(name: object, allowed: Collection[str]) -> str:
    """Return "unknown", the nearest of the `allowed` names if one is near, and a list of all.

    With a near name a long list is left out.
    """
    near = get_close_matches(str(name), allowed, 1)
    meant = f", did you mean {near[0]}?" if near else ";"
    listed = f" allowed: {', '.join(allowed) or 'nothing'}"
    return f"unknown{meant}" + ("" if near and len(allowed) > SHORT else listed)
