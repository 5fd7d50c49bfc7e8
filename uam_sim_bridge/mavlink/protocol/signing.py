"""MAVLink 2 signing: what is not signed with the shared key, or was heard before, is refused.

pymavlink signs and checks. Its time runs in steps of 10 us since 2015-01-01, from the wall clock,
and never backwards within a process: a packet whose time is not above that of the last one of
its sender and link is a replay. A sender not heard before may be at most a minute behind.
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
    from pymavlink.dialects.v20.common import MAVLink

EPOCH = 1_420_070_400  # 2015-01-01 00:00 UTC as Unix time [s]
_STEPS = 100_000  # per second
_KEY = re.compile(r"[0-9a-fA-F]{64}")
_FILE_LIMIT = 200  # bytes: a key and some white space


def wall_steps() -> int:
    """Return the time of signatures now: 10 us since 2015-01-01."""
    return max(0, time.time_ns() // 10_000 - EPOCH * _STEPS)


@dataclass(frozen=True)
class Signing:
    """The shared key (32 bytes, never shown), the number of this link (0..255) and the clock."""

    key: bytes = field(repr=False)
    link_id: int = 0
    clock: Callable[[], int] = wall_steps

    @classmethod
    def from_text(cls, text: str, link_id: int = 0) -> Signing | None:
        """Return the signing that `text` asks for: 64 hex digits, or a file of them; '' is none.

        Raises PortError in one line, which does not repeat the text: it may be a key.
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
    """Switches signing on in one pymavlink object (`mav`) and keeps its time and counts."""

    def __init__(self, mav: MAVLink, signing: Signing) -> None:
        self._state, self._clock = mav.signing, signing.clock
        self._state.secret_key = signing.key
        self._state.link_id = signing.link_id
        self._state.sign_outgoing = True
        self._state.allow_unsigned_callback = lambda *_: False  # makes it count what it refuses
        self._heard: dict[tuple[int, int, int], int] = {}

    @property
    def refused(self) -> int:
        """How many whole messages were refused."""
        return self._state.reject_count

    def refresh(self) -> None:
        """Bring the time of signatures up to the clock; it never goes back."""
        self._state.timestamp = max(self._state.timestamp, self._clock())

    def settle(self, accepted: bool) -> None:
        """Keep the times of the senders after a good signature, take them back after a bad one.

        pymavlink notes a packet's time before it checks the signature: one forged packet from the
        future would shut its sender out.
        """
        if accepted:
            self._heard = dict(self._state.stream_timestamps)
        else:
            self._state.stream_timestamps = dict(self._heard)
