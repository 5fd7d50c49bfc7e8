"""MAVLink 2 signing: refuses packets without the shared key's signature, and replays.

pymavlink signs and checks. The time of signatures has steps of 10 us since 2015-01-01 (wall clock)
and never decreases within a process. A packet is a replay if its time is not above that of the
last packet of its sender and link. The first packet of a sender may be at most a minute old.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from uam_sim_bridge.ports import PortError

if TYPE_CHECKING:
    from pymavlink.dialects.v20.development import MAVLink

EPOCH = 1_420_070_400  # 2015-01-01 00:00 UTC as Unix time [s]
_STEPS = 100_000  # per second
_KEY = re.compile(r"[0-9a-fA-F]{64}")
_FILE_LIMIT = 200  # bytes: a key and some white space


def wall_steps() -> int:
    """Return the current time of signatures: steps of 10 us since 2015-01-01."""
    return max(0, time.time_ns() // 10_000 - EPOCH * _STEPS)


@dataclass(frozen=True)
class Signing:
    """Shared key (32 bytes, not in repr), id of this link (0..255) and clock (see wall_steps)."""

    key: bytes = field(repr=False)
    link_id: int = 0
    clock: Callable[[], int] = wall_steps

    @classmethod
    def from_text(cls, text: str, link_id: int = 0) -> Signing | None:
        """Return the signing of `text`: 64 hex digits, or a file with them; None for ''.

        Raises PortError in one line. The message does not contain the text, which may be a key.
        """
        if not text:
            return None
        if not _KEY.fullmatch(text):
            try:
                with Path(text).expanduser().open("rb") as file:
                    text = file.read(_FILE_LIMIT).decode("ascii").strip()
            except (OSError, ValueError, RuntimeError) as error:
                reason = getattr(error, "strerror", None) or "not a text"
                raise PortError(
                    f"signing key: not 64 hex digits, and as a file: {reason}"
                ) from None
            if not _KEY.fullmatch(text):
                raise PortError("signing key: the file does not hold 64 hex digits")
        return cls(bytes.fromhex(text), link_id)


class Seal:
    """Enables signing in one pymavlink object (`mav`); updates its time, counts refused packets."""

    def __init__(self, mav: MAVLink, signing: Signing) -> None:
        self._state, self._clock = mav.signing, signing.clock
        self._state.secret_key = signing.key
        self._state.link_id = signing.link_id
        self._state.sign_outgoing = True
        self._state.allow_unsigned_callback = lambda *_: False  # needed for reject_count
        self._accepted: dict[tuple[int, int, int], int] = {}

    @property
    def refused(self) -> int:
        """Return the number of refused messages."""
        return self._state.reject_count

    def refresh(self) -> None:
        """Set the time of signatures to the clock; it never decreases."""
        self._state.timestamp = max(self._state.timestamp, self._clock())

    def settle(self, accepted: bool) -> None:
        """Save the senders' times after a valid signature, restore them after an invalid one.

        pymavlink stores a packet's time before it checks the signature: a forged packet with a
        future time would otherwise lock out the true sender.
        """
        if accepted:
            self._accepted = dict(self._state.stream_timestamps)
        else:
            self._state.stream_timestamps = dict(self._accepted)
