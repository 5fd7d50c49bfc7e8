"""The line with its servos: instruction packets in, status packets out, with faults.

No thread and no device: a test may call it directly. `EmulatedBus` puts a line behind a
pseudo-terminal, with its timing: the driver opens its `port`, a device like /dev/ttyUSB0, and one
thread serves the other end.
"""

from __future__ import annotations

import select
import termios
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from uam_sim_bridge.devices.dynamixel import protocol
from uam_sim_bridge.devices.dynamixel.control_table import BAUD_RATES
from uam_sim_bridge.devices.dynamixel.emulated.servo import EmulatedServo
from uam_sim_bridge.devices.dynamixel.protocol import BROADCAST, STATUS, Packet, PacketReader
from uam_sim_bridge.devices.serial.serial_cable import DeviceThread, PseudoTerminal, disturbed
from uam_sim_bridge.devices.serial.serial_port import BITS_PER_BYTE

PING_SLOT = 0.001  # [s] between answers to a broadcast ping
IDLE = 0.01  # [s] between two looks at the watchdogs of a silent bus
_SPEEDS = {
    getattr(termios, f"B{rate}"): rate for rate in BAUD_RATES if hasattr(termios, f"B{rate}")
}


class ServoLine:
    """Servos on one line.

    Servos of one id answer at the same time: their bytes overlap and are damaged. In a Sync Read a
    servo waits for the one named before it; if that one is silent, so are all after it.
    """

    def __init__(self, servos: Sequence[EmulatedServo], seed: int = 1) -> None:
        """seed: of the faults."""
        self.servos, self.instructions = list(servos), 0  # packets understood
        self.bit_error_rate = self.loss = 0.0  # of every bit, of a whole packet, in both directions
        self._noise = np.random.default_rng(seed)
        self._reader = PacketReader()

    @property
    def damaged(self) -> int:
        """Number of instruction packets that arrived damaged."""
        return self._reader.damaged

    def receive(self, data: bytes, speed: int | None) -> Iterator[tuple[float, bytes]]:
        """Take bytes at a baud rate, None: any; yield (delay [s], bytes) of each answer."""
        for packet in self._reader.feed(self._disturbed(data)):
            if packet.instruction == STATUS or self._lost():
                continue
            listening = [
                one for one in self.servos if one.connected and speed in (None, one.baud_rate)
            ]
            self.instructions += 1
            for one in listening:
                one.tick(heard=True)
            for delay, answer in self._answers(packet, listening):
                if not self._lost():
                    yield delay, self._disturbed(answer)

    def tick(self) -> None:
        """Let the servos' watchdogs run while the line is silent."""
        for servo in self.servos:
            servo.tick(heard=False)

    def cut_behind(self, servo: int) -> None:
        """Cut the chain behind servo `servo`, 0 for all: the ones after it have no supply."""
        on = servo != 0
        for one in self.servos:
            if not on and one.connected:
                one.restart()
            one.connected = on
            on = on and one.id != servo

    def mend(self) -> None:
        """Connect every servo again; those without supply have restarted."""
        for one in self.servos:
            one.connected = True

    def _lost(self) -> bool:
        return self.loss > 0.0 and self._noise.random() < self.loss

    def _disturbed(self, data: bytes) -> bytes:
        """Return `data` with bit errors."""
        return disturbed(data, self.bit_error_rate, self._noise)

    def _answers(self, packet: Packet, listening: list[EmulatedServo]) -> list[tuple[float, bytes]]:
        """Execute an instruction; return (delay [s], bytes) of each status packet."""
        p, code = packet.parameters, packet.instruction
        if code in (protocol.SYNC_READ, protocol.FAST_SYNC_READ):
            return self._sync_read(packet, listening)
        if code == protocol.SYNC_WRITE:
            self._sync_write(p, listening)
            return []
        chosen = [one for one in listening if packet.id in (BROADCAST, one.id)]
        made = [(one, self._single(one, code, p)) for one in chosen]
        if packet.id == BROADCAST and code != protocol.PING:
            return []
        found = [(one, data) for one, data in made if data is not None]
        if packet.id == BROADCAST:
            return [(PING_SLOT, data) for _, data in sorted(found, key=lambda pair: pair[0].id)]
        if len(found) > 1:  # of the same id, at the same time: open-drain, a 0 wins
            width = max(len(data) for _, data in found)
            mixed = np.full(width, 0xFF, np.uint8)
            for shift, (_, data) in enumerate(found):
                late = bytes([0xFF] * shift) + data
                mixed &= np.frombuffer(late.ljust(width, b"\xff")[:width], np.uint8)
            return [(found[0][0].return_delay, mixed.tobytes())]
        return [(one.return_delay, data) for one, data in found]

    @staticmethod
    def _single(servo: EmulatedServo, code: int, p: bytes) -> bytes | None:
        """Execute an instruction for one servo; return its status packet or None."""
        level, own = servo.get("Status Return Level"), servo.id
        if code == protocol.PING:
            number, firmware = servo.get("Model Number"), servo.get("Firmware Version")
            return protocol.status(
                own, servo.alert, number.to_bytes(2, "little") + bytes([firmware])
            )
        if code == protocol.READ:
            if len(p) != 4:
                return protocol.status(own, protocol.DATA_LENGTH | servo.alert)
            error, data = servo.read(_word(p), _word(p[2:]))
            return protocol.status(own, error, data) if level >= 1 else None
        if code == protocol.WRITE:
            error = servo.write(_word(p), p[2:])
        elif code == protocol.REBOOT:
            error = servo.alert
            servo.restart()
        else:
            error = protocol.BAD_INSTRUCTION | servo.alert
        return protocol.status(own, error) if level >= 2 else None

    @staticmethod
    def _sync_write(p: bytes, listening: list[EmulatedServo]) -> None:
        address, length = _word(p), _word(p[2:])
        for start in range(4, len(p) - length, 1 + length):
            data = p[start + 1 : start + 1 + length]
            for one in listening:
                if one.id == p[start]:
                    one.write(address, data)

    @staticmethod
    def _sync_read(packet: Packet, listening: list[EmulatedServo]) -> list[tuple[float, bytes]]:
        p = packet.parameters
        address, length = _word(p), _word(p[2:])
        answers, by_id = [], {one.id: one for one in listening}
        for number in p[4:]:
            if number not in by_id:
                break
            one = by_id[number]
            error, data = one.read(address, length)
            answers.append((one, error, data))
        if packet.instruction == protocol.SYNC_READ:
            return [(one.return_delay, protocol.status(one.id, e, d)) for one, e, d in answers]
        if not answers:
            return []
        padded = [(one.id, e, d.ljust(length, b"\0")) for one, e, d in answers]
        parts = protocol.fast_status(padded, len(p) - 4)
        return [(answers[0][0].return_delay, parts[0]), *((0.0, part) for part in parts[1:])]


def _word(data: bytes) -> int:
    return int.from_bytes(data[:2], "little")


class EmulatedBus:
    """A pseudo-terminal with servos; `timing`: answers take as long as on the wire."""

    def __init__(
        self,
        servos: Sequence[EmulatedServo],
        timing: bool = False,
        latency_timer: float = 0.0,
        seed: int = 1,
        link: Path | None = None,
    ) -> None:
        """latency_timer [s] of the USB adapter, before an answer; seed: of the faults; link: a path
        that stays the same when the cable is unplugged and plugged in again."""
        self.line = ServoLine(servos, seed)  # the servos and their faults
        self._timing, self._latency, self._link = timing, latency_timer, link
        self._terminal: PseudoTerminal | None = None
        self.port = ""  # path of the device
        self._thread = DeviceThread("emulated bus", self._serve)
        self.plug_in()
        self._thread.start()

    def plug_in(self) -> None:
        """Create the device; its path is `port`."""
        with self._thread.changed():
            if self._terminal is None:
                self._terminal = PseudoTerminal(self._link)
                self.port = self._terminal.path

    def unplug(self) -> None:
        """Remove the device, as a pulled USB cable; the servos keep their supply."""
        with self._thread.changed():
            if self._terminal is not None:
                self._terminal.close()
            self._terminal = None

    def close(self) -> None:
        self._thread.end()
        self.unplug()

    def _serve(self) -> None:
        """Answer what comes, or let the watchdogs of a silent bus run."""
        if self._terminal is None:
            time.sleep(IDLE)
        if self._terminal is None or not select.select([self._terminal], [], [], IDLE)[0]:
            self.line.tick()
        else:
            self._answer(self._terminal, time.monotonic())

    def _answer(self, terminal: PseudoTerminal, started: float) -> None:
        """Hand the bytes to the line; send the answers at their times.

        An adapter with a latency timer keeps what it receives within this time, and hands it over
        at once.
        """
        data, speed = terminal.read(), _SPEEDS.get(terminal.speed)
        sent = started + self._duration(len(data), speed) + self._latency
        first, kept = sent, b""
        for delay, answer in self.line.receive(data, speed):
            due = sent + delay + self._duration(len(answer), speed)
            if kept and due > first + self._latency:
                self._send(terminal, kept, sent)
                kept = b""
            if not kept:
                first = due
            kept, sent = kept + answer, due
        if kept:
            self._send(terminal, kept, sent)

    def _send(self, terminal: PseudoTerminal, data: bytes, at: float) -> None:
        """Hand over bytes at `at` [s], with timing."""
        left = at - time.monotonic()
        if self._timing and left > 0.0:
            time.sleep(left)
        terminal.write(data)

    def _duration(self, count: int, speed: int | None) -> float:
        return BITS_PER_BYTE * count / speed if self._timing and speed else 0.0
