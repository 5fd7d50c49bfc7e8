"""Bytes ↔ MAVLink 2 messages, robust against invalid bytes; signing of MAVLink 2.

After a false start byte pymavlink's stream parser skips as many bytes as the false length says.
`Framer` continues one byte after a false start, so that invalid bytes never hide a valid message
behind them.

pymavlink signs and checks. Packets without the shared key's signature are refused, and replays. The
time of signatures has steps of 10 us since 2015-01-01 (wall clock) and never decreases within a
process. A packet is a replay if its time is not above that of the last packet of its sender and
link. The first packet of a sender may be at most a minute old.
"""

from __future__ import annotations

import re
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from pymavlink.dialects.v20 import development as mavlink2

from uam_control.settings.texts import visible
from uam_sim_bridge.ports import PortError

MARKER_1, MARKER_2 = 0xFE, 0xFD
_OVERHEAD_1, _OVERHEAD_2, _SIGNATURE = 8, 12, 13
_SIGNED = 1  # incompatibility flag
_AUTOPILOT = 15  # index of HEARTBEAT.autopilot in a frame
_MARKERS = re.compile(b"[\xfd\xfe]")

# Messages that PX4 sends and pymavlink omits (work in progress in MAVLink): id → CRC_EXTRA. The
# framer recognises these frames but does not decode them. (EVENT is decoded: events.py.)
UNREAD = {8: 117, 290: 251, 291: 10, 361: 93, 371: 10, 380: 232, 411: 106, 413: 77}

Message = mavlink2.MAVLink_message

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


class Codec:
    """Encodes messages of one sender (system and component id) and decodes those of others.

    With `signing` it signs every frame and decodes only frames with a valid signature.
    """

    def __init__(self, system: int, component: int, signing: Signing | None = None) -> None:
        self._mav = mavlink2.MAVLink(None, srcSystem=system, srcComponent=component)
        self._signing, self._signed = signing, self._mav.signing
        self._accepted: dict[tuple[int, int, int], int] = {}  # times of the senders
        self.unsigned: int | None = None  # MAV_AUTOPILOT of the newest heartbeat without signature
        if signing is not None:
            self._signed.secret_key, self._signed.link_id = signing.key, signing.link_id
            self._signed.sign_outgoing = True
            self._signed.allow_unsigned_callback = lambda *_: False  # needed for reject_count

    @property
    def refused(self) -> int:
        """Return the number of refused frames: unsigned, signed with another key, or replayed."""
        return self._signed.reject_count

    def encode(self, message: Message) -> bytes:
        """Return the numbered frame. Raises struct.error if a value does not fit its field."""
        self._set_time()
        frame = message.pack(self._mav)
        self._mav.seq = (self._mav.seq + 1) % 256
        return frame

    def decode(self, frame: bytes) -> Message | None:
        """Return the message of a whole frame, None if the frame is invalid.

        A message that is not in the dialect is invalid: its checksum cannot be tested.
        """
        self._set_time()
        message = None
        try:
            message = self._mav.decode(bytearray(frame))
        except (mavlink2.MAVError, struct.error, ValueError, IndexError, KeyError):
            pass
        # pymavlink stores a packet's time before it checks the signature: a forged packet with a
        # future time would otherwise lock out the true sender
        if message is not None:
            self._accepted = dict(self._signed.stream_timestamps)
        elif self._signing is not None:
            self._signed.stream_timestamps = dict(self._accepted)
            self._note_unsigned(frame)
        return None if isinstance(message, mavlink2.MAVLink_unknown) else message

    def _set_time(self) -> None:
        """Set the time of signatures to the clock; it never decreases."""
        if self._signing is not None:
            self._signed.timestamp = max(self._signed.timestamp, self._signing.clock())

    def _note_unsigned(self, frame: bytes) -> None:
        """Take the kind of autopilot from an unsigned heartbeat (MAVLink 2)."""
        heartbeat = len(frame) > _AUTOPILOT and frame[0] == MARKER_2
        if heartbeat and not frame[2] & _SIGNED and message_number(frame, 0) == 0:
            kind = frame[_AUTOPILOT]
            if kind != mavlink2.MAV_AUTOPILOT_INVALID:
                self.unsigned = kind


class Framer:
    """Extracts messages from a byte stream (TCP, serial) or from single datagrams.

    A frame that the codec refuses for its signature is skipped whole.
    """

    def __init__(self, codec: Codec) -> None:
        self._codec = codec
        self._rest = b""
        self.bad_bytes = self.unread = 0  # bytes outside valid frames; frames of messages in UNREAD

    def stream(self, data: bytes) -> list[Message]:
        """Return the messages completed by `data`; store an incomplete frame for the next call."""
        data = self._rest + data
        messages, used = self._cut(data, final=False)
        self._rest = data[used:]
        return messages

    def datagram(self, data: bytes) -> list[Message]:
        """Return the messages of one datagram; an incomplete frame is dropped."""
        return self._cut(data, final=True)[0]

    def take(self, data: bytes, stream: bool) -> list[Message]:
        """Return the messages of a chunk of a stream, or of one datagram."""
        return self.stream(data) if stream else self.datagram(data)

    def _cut(self, data: bytes, final: bool) -> tuple[list[Message], int]:
        messages: list[Message] = []
        at, size = 0, len(data)
        while at < size:
            marker = data[at]
            if marker not in (MARKER_1, MARKER_2):
                start = _next_marker(data, at)
                self.bad_bytes += start - at
                at = start
                continue
            end = _frame_end(data, at)
            if end is None or end > size:
                if not final:
                    break
            elif checksum_fits(data, at, end):
                refused = self._codec.refused
                message = self._codec.decode(data[at:end])
                if message is not None:
                    messages.append(message)
                if message is not None or self._codec.refused > refused:  # refused: skip it
                    at = end
                    continue
                if message_number(data, at) in UNREAD:
                    self.unread += 1
                    at = end
                    continue
            at += 1  # false start: continue one byte later
            self.bad_bytes += 1
        return messages, at


def _next_marker(data: bytes, at: int) -> int:
    found = _MARKERS.search(data, at)
    return found.start() if found else len(data)


def message_number(data: bytes, at: int) -> int:
    """Return the message id of the frame that begins at data[at]; needs 10 bytes from there."""
    if data[at] == MARKER_1:
        return data[at + 5]
    return int.from_bytes(data[at + 7 : at + 10], "little")


def checksum_fits(data: bytes, at: int, end: int) -> bool:
    """Return whether the frame data[at:end] is of a known message type and its checksum is right.

    end: from the length in the frame's header. This check is ten times faster than decoding; it
    prevents a datagram full of false starts from blocking the control loop for half a second.
    """
    if end - at < (_OVERHEAD_1 if data[at] == MARKER_1 else _OVERHEAD_2):
        return False
    number, tail = message_number(data, at), end - 2
    if data[at] == MARKER_2 and data[at + 2] & _SIGNED:
        tail -= _SIGNATURE
    kind = mavlink2.mavlink_map.get(number)
    extra = UNREAD.get(number) if kind is None else kind.crc_extra
    if extra is None:
        return False
    checksum = mavlink2.x25crc(data[at + 1 : tail] + bytes((extra,))).crc
    return checksum == data[tail] | data[tail + 1] << 8


def _frame_end(data: bytes, at: int) -> int | None:
    """Return the end index of the frame that starts at `at`; None without enough bytes."""
    if len(data) - at < 3:
        return None
    if data[at] == MARKER_1:
        return at + data[at + 1] + _OVERHEAD_1
    flags = data[at + 2]
    if flags & ~_SIGNED:
        return at + 1  # unknown flags: a length that checksum_fits refuses
    return at + data[at + 1] + _OVERHEAD_2 + (_SIGNATURE if flags & _SIGNED else 0)


def text_chunks(severity: int, text: str, number: int) -> list[Message]:
    """Return the STATUSTEXT messages of `text`, in pieces of 50 bytes.

    number: selects the id of a text with several pieces.
    """
    raw = text.encode()
    pieces = [raw[i : i + 50] for i in range(0, len(raw), 50)] or [b""]
    if len(pieces) > 1 and len(pieces[-1]) == 50:
        pieces.append(b"")  # a piece below 50 bytes marks the end of the text
    identity = number % 65535 + 1 if len(pieces) > 1 else 0
    return [
        mavlink2.MAVLink_statustext_message(severity, piece, id=identity, chunk_seq=i)
        for i, piece in enumerate(pieces)
    ]


class TextAssembler:
    """Joins the pieces of long STATUSTEXT messages."""

    def __init__(self) -> None:
        self._identity = 0
        self._pieces: list[str] = []

    def add(self, message: Message) -> str | None:
        """Return the whole text, in one line, with its last piece; None before or without one."""
        text = clean_text(message.text)
        if message.id == 0:
            return visible(text)
        if message.id != self._identity or message.chunk_seq == 0:
            self._identity, self._pieces = message.id, []
        if message.chunk_seq != len(self._pieces):  # a piece was lost
            self._pieces = []
            return None
        self._pieces.append(text)
        if len(text.encode()) == 50:
            return None
        whole, self._pieces = "".join(self._pieces), []
        return visible(whole)


def clean_text(value: str | bytes) -> str:
    """Return the text of a MAVLink string: up to its first zero byte."""
    if isinstance(value, bytes):
        value = value.decode(errors="replace")
    return value.split("\x00", 1)[0]
