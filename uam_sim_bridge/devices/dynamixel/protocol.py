"""Packets of Dynamixel Protocol 2.0, for the driver and for the emulated servos.

Header FF FF FD 00, id, length (2 bytes), instruction, parameters, CRC-16. Source: ROBOTIS e-manual,
Protocol 2.0. The maker's library is the other end in the tests; why it is not used:
docs/architecture.md.
"""

from dataclasses import dataclass

HEADER = b"\xff\xff\xfd\x00"
STUFFED = b"\xff\xff\xfd"  # followed by a stuffed FD between header and CRC
BROADCAST = 0xFE
LAST_ID = 0xFC
SHORTEST, LONGEST = 3, 1024  # value of the length field

PING, READ, WRITE, REBOOT = 0x01, 0x02, 0x03, 0x08
STATUS, SYNC_READ, SYNC_WRITE, FAST_SYNC_READ = 0x55, 0x82, 0x83, 0x8A

# Error field of a status packet
RESULT_FAIL, BAD_INSTRUCTION, BAD_CRC, DATA_RANGE = 0x01, 0x02, 0x03, 0x04
DATA_LENGTH, DATA_LIMIT, ACCESS = 0x05, 0x06, 0x07
ALERT = 0x80


def _crc_table() -> list[int]:
    table = []
    for byte in range(256):
        value = byte << 8
        for _ in range(8):
            value = (value << 1) ^ 0x8005 if value & 0x8000 else value << 1
        table.append(value & 0xFFFF)
    return table


_TABLE = _crc_table()


def crc16(data: bytes, start: int = 0) -> int:
    """Return the CRC-16 (polynomial 8005, initial value 0) of `data`; start: of the data before."""
    value = start
    for byte in data:
        value = ((value << 8) ^ _TABLE[(value >> 8) ^ byte]) & 0xFFFF
    return value


@dataclass(frozen=True)
class Packet:
    """An instruction, or a STATUS packet: error, then data; parameters without stuffing."""

    id: int
    instruction: int
    parameters: bytes = b""

    def encode(self) -> bytes:
        """Return the bytes on the wire, with FD after each FF FF FD."""
        body = (bytes([self.instruction]) + self.parameters).replace(STUFFED, STUFFED + b"\xfd")
        packet = HEADER + bytes([self.id]) + (len(body) + 2).to_bytes(2, "little") + body
        return packet + crc16(packet).to_bytes(2, "little")


def word(value: int, size: int) -> bytes:
    """Return a signed or unsigned value as `size` bytes, the lowest first."""
    return (value & ((1 << 8 * size) - 1)).to_bytes(size, "little")


def status(servo: int, error: int, parameters: bytes = b"") -> bytes:
    return Packet(servo, STATUS, bytes([error]) + parameters).encode()


def fast_status(answers: list[tuple[int, int, bytes]], expected: int) -> list[bytes]:
    """Return the parts of the answer to a Fast Sync Read, one per servo that answers.

    answers: (id, error, data); expected: number of servos named in the instruction, which sets the
    length field. Each part ends with the CRC of all bytes so far. There is no byte stuffing.
    """
    size = len(answers[0][2])
    length = 1 + expected * (size + 4)
    head = HEADER + bytes([BROADCAST]) + length.to_bytes(2, "little") + bytes([STATUS])
    parts, crc = [], 0
    for i, (servo, error, data) in enumerate(answers):
        part = (b"" if i else head) + bytes([error, servo]) + data
        crc = crc16(part, crc)
        end = crc.to_bytes(2, "little")
        crc = crc16(end, crc)
        parts.append(part + end)
    return parts


class PacketReader:
    """Finds packets in a stream of bytes; damaged ones are counted and skipped."""

    def __init__(self) -> None:
        self._bytes = b""
        self.damaged = 0

    def feed(self, data: bytes) -> list[Packet]:
        """Return the packets that `data` completes."""
        self._bytes += data
        found = []
        while (packet := self._next()) is not None:
            found.append(packet)
        return found

    def _next(self) -> Packet | None:
        while True:
            start = self._bytes.find(HEADER)
            if start < 0:
                self._bytes = self._bytes[-3:]
                return None
            self._bytes = self._bytes[start:]
            if len(self._bytes) < 8:
                return None
            length = int.from_bytes(self._bytes[5:7], "little")
            fast = self._bytes[4] == BROADCAST and self._bytes[7] == STATUS  # has no stuffing
            if not SHORTEST <= length <= LONGEST:
                self._skip_header()
                continue
            # a header cannot occur within a packet: FF FF FD would be followed by FD
            again = self._bytes.find(HEADER, 4, 5 + length)
            if again > 0 and not fast:
                self.damaged += 1
                self._bytes = self._bytes[again:]
                continue
            if len(self._bytes) < 7 + length:
                return None
            whole, crc = self._bytes[: 5 + length], self._bytes[5 + length : 7 + length]
            if crc16(whole) != int.from_bytes(crc, "little"):
                self._skip_header()
                continue
            self._bytes = self._bytes[7 + length :]
            body = whole[7:] if fast else whole[7:].replace(STUFFED + b"\xfd", STUFFED)
            return Packet(whole[4], body[0], body[1:])

    def _skip_header(self) -> None:
        self.damaged += 1
        self._bytes = self._bytes[len(HEADER) :]
