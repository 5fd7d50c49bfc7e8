"""The simulator's side of the HIL link: a TCP server to which an autopilot (PX4 SITL, or the
stand-in) connects. Each tick sends HIL_SENSOR and waits for HIL_ACTUATOR_CONTROLS.

The wait is limited by the first of WAITS if the autopilot answered the last tick, else by the
second. PX4 sends no answer during boot and while disarmed without a setpoint stream.
"""

import ipaddress
import select
import socket
from collections.abc import Callable
from typing import Any

import numpy as np

from uam_sim_bridge.mavlink.hil.hil_messages import HilMessages
from uam_sim_bridge.paced_clock import SLICE, Patience
from uam_sim_bridge.ports import PortError, bound

WAITS = 2.0, 0.05  # [s] of wall time


def open_only_here(address: str) -> bool:
    """Return whether only programs of this machine can connect to a port at `address`.

    Raises PortError if it is no IPv4 address.
    """
    try:
        return ipaddress.IPv4Address(address).is_loopback
    except ValueError:
        raise PortError(
            f"address '{address}' for the autopilot: an IPv4 address expected, as 127.0.0.1"
        ) from None


class HilServer(HilMessages):
    """TCP server for one autopilot at a time."""

    def __init__(
        self,
        port: int,
        motors: int,
        host: str = "127.0.0.1",
        waits: tuple[float, float] = WAITS,
        seed: int = 0,
    ) -> None:
        """Listen on TCP `port` for `motors` motors; waits [s]: see WAITS; seed: of the noise.

        Raises PortError if the port is in use.
        """
        super().__init__(motors, seed)
        self._waits = waits
        self.answered = False  # whether the last tick was
        self.missed = 0  # ticks without an answer after the first answer
        self._ever = False
        self._link: socket.socket | None = None
        self._listener = bound("TCP", host, port, f"the autopilot at {host}")

    @property
    def connected(self) -> bool:
        return self._link is not None

    def accept(self, timeout: float) -> bool:
        """Wait up to `timeout` [s] for a connection; return whether an autopilot is connected."""
        if self._link is None and select.select([self._listener], [], [], timeout)[0]:
            self._link, _ = self._listener.accept()
            self._link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._link.setblocking(False)
        return self.connected

    def prepare(self, *sample: Any) -> None:
        if self._link is not None:
            super().prepare(*sample)

    def _put(self, data: bytes) -> None:
        if self._link is None:
            return
        try:
            self._link.settimeout(self._waits[0])
            self._link.sendall(data)
            self._link.setblocking(False)
        except OSError:
            self._stop()

    def receive(
        self, timeout: float | None = None, going_on: Callable[[], bool] = lambda: True
    ) -> np.ndarray:
        """Wait for the answer to the last `send`; return `motors` (n,), also without an answer.

        Without a connection, or if the autopilot closes it, the motors are zero. timeout: wall time
        [s]; None for one of `waits` (module docstring). going_on: called
        while it waits; False ends the wait.
        """
        if self._link is None:
            return self.motors
        if timeout is None:
            timeout = self._waits[0] if self.answered else self._waits[1]
        self.answered = False
        patience = Patience(timeout)
        while not self.answered and going_on():
            left = patience.left
            if select.select([self._link], [], [], min(left, SLICE / 2))[0]:
                if not self._receive():
                    return self._stop()
            elif not left:
                break
        self._ever = self._ever or self.answered
        self.missed += self._ever and not self.answered
        return self.motors

    def close(self) -> None:
        self._stop()
        self._listener.close()

    def _receive(self) -> bool:
        try:
            data = self._link.recv(65536)
        except BlockingIOError:
            return True
        except OSError:
            return False
        for message in self._framer.stream(data):
            if self.take(message):
                self.answered = self.answered or message.time_usec >= self.stamp
        return bool(data)

    def _stop(self) -> np.ndarray:
        if self._link is not None:
            self._link.close()
            self._link, self._prepared = None, b""
        self._ever = self.answered = False
        return self.forget()
