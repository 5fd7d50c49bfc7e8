"""Foreign text for a terminal or a log: what a terminal would obey becomes visible."""

from __future__ import annotations

import re

# C0 without the tab, DEL, C1; separators of lines; marks that turn the direction of reading
OBEYED = re.compile(
    r"[\x00-\x08\x0a-\x1f\x7f-\x9f\u2028\u2029\u200e\u200f\u202a-\u202e\u2066-\u2069]"
)


def visible(text: object) -> str:
    """Return `text` in one line, with the picture of each control character in its place.

    "\\x1b" becomes "␛", a newline "␊"; characters without a picture become "�".
    """
    return OBEYED.sub(_picture, str(text))


def _picture(found: re.Match[str]) -> str:
    code = ord(found[0])
    return chr(0x2400 + code) if code < 0x20 else "␡" if code == 0x7F else "�"
