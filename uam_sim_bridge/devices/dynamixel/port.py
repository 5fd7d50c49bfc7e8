"""Serial port of the maker's library, with the waits of this driver."""

from __future__ import annotations

import select
import time

from uam_sim_bridge.devices.dynamixel.sdk import PortHandler


class PatientPort(PortHandler):
    """The SDK's port without its fixed latency of 16 ms, and without its busy wait.

    The SDK allows 34 ms for every answer and reads without blocking meanwhile. Here an answer has
    the time of its bytes plus `allowance` [s], and a read sleeps until bytes arrive.
    """

    def __init__(self, device: str, allowance: float) -> None:
        super().__init__(device)
        self.allowance = allowance  # [s]
        self._sent = 0  # bytes since the last answer, which may still be on their way out

    def getCurrentTime(self) -> float:
        """Return the time [ms] of a clock that never steps."""
        return 1e3 * time.monotonic()

    def setPacketTimeout(self, packet_length: int) -> None:
        """Begin to wait for an answer of `packet_length` bytes."""
        on_the_wire = self.tx_time_per_byte * (packet_length + self._sent)
        self.setPacketTimeoutMillis(on_the_wire + 1e3 * self.allowance)
        self._sent = 0

    def writePort(self, packet: list[int]) -> int:
        """Send bytes; return their number."""
        self._sent += len(packet)
        return super().writePort(packet)

    def readPort(self, length: int) -> bytes:
        """Return up to `length` bytes; wait for the first one until the answer is late."""
        left = 1e-3 * (self.packet_timeout - self.getTimeSinceStart())
        if left > 0.0 and not self.ser.in_waiting:
            select.select([self.ser.fileno()], [], [], left)
        return self.ser.read(length)
