"""Ports as in PX4 SITL, UDP to the companion, TCP to the simulator; executables that have them."""

import argparse
import math
import socket
import time as clock
from collections.abc import Callable
from typing import Any

from uam_control.vehicle import DEFAULT_VEHICLE
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, Message
from uam_sim_bridge.paced_clock import Patience
from uam_sim_bridge.ports import AUTOPILOT_UDP, OFFBOARD_UDP, SIMULATOR_TCP, PortError, bound

HOST = "127.0.0.1"
SILENT = 5.0  # [s]; does not count while the simulation stands still


class UdpPort:
    """UDP to the companion computer; like PX4, answers only the first peer with a valid message.

    After SILENT without a message of this peer the next one with a valid message takes its place.
    """

    def __init__(self, local: int, remote: int, codec: Codec) -> None:
        """local: port to listen on; remote: destination until the first peer sends a message.

        Raises PortError if the local port is in use.
        """
        purpose = "the companion computer (--mavlink-port)"
        self._socket = bound("UDP", HOST, local, purpose)
        self._socket.setblocking(False)
        self._codec = codec
        self._framer = Framer(codec)
        self._peer = (HOST, remote)
        self._silence: Patience | None = None  # of the peer; None: before the first message

    def receive(self) -> list[Message]:
        messages: list[Message] = []
        silent = self._silence is None or self._silence.over
        while True:
            try:
                data, sender = self._socket.recvfrom(65535)
            except BlockingIOError:
                return messages
            except ConnectionError:  # the peer's port was closed at the last send
                continue
            if not silent and sender != self._peer:
                continue
            new = self._framer.datagram(data)
            if new:
                self._peer, self._silence, silent = sender, Patience(SILENT), False
            messages += new

    def send(self, messages: list[Message]) -> None:
        """Send each message in its own datagram; a closed port of the peer is no error."""
        for message in messages:
            self.send_frame(self._codec.encode(message))

    def send_frame(self, frame: bytes) -> None:
        """Send one encoded message unchanged."""
        try:
            self._socket.sendto(frame, self._peer)
        except (BlockingIOError, ConnectionError):
            pass

    def fileno(self) -> int:
        return self._socket.fileno()

    def close(self) -> None:
        self._socket.close()


def connect(name: str, host: str, port: int, patience: float) -> socket.socket:
    """Return a TCP connection to the simulator; waits up to `patience` [s] for its port to open.

    name: program name in the printed line. Raises PortError after this time.
    """
    end = clock.monotonic() + patience
    printed = False
    while True:
        try:
            link = socket.create_connection((host, port), timeout=min(max(0.1, patience), 60.0))
            break
        except socket.gaierror as error:
            raise PortError(f"simulator host {host}: {error.strerror}") from None
        except OSError as error:
            if clock.monotonic() > end:
                raise PortError(
                    f"no simulator at {host}:{port} within {patience:g} s "
                    f"({error.strerror or 'no answer'})"
                ) from None
            if not printed:
                print(f"{name}: waiting for the simulator at {host}:{port}", flush=True)
                printed = True
            clock.sleep(0.05)
    link.settimeout(None)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return link


def within(kind: Callable[[str], float], what: str, low: float, high: float) -> Callable:
    """Return an argparse type: int or float from `low` to `high`; what: its name in errors."""

    def read(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text} is not {what} ({low:.9g}..{high:.9g})")
        return value

    return read


class Program(argparse.ArgumentParser):
    """The parser of an executable; its methods add options, with the default in the help."""

    def __init__(self, page: str) -> None:
        """page: the docstring of its module, Executable `name`: ..., which is its help."""
        super().__init__(
            prog=page.split("`")[1],
            description=page,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )

    def option(self, flag: str, metavar: str, text: str, default: Any = None, **how: Any) -> None:
        """Add an option with a value."""
        if default not in (None, ""):
            text = f"{text} (default %(default)s)"
        self.add_argument(flag, metavar=metavar, help=text, default=default, **how)

    def switch(self, flag: str, text: str) -> None:
        """Add an option without a value."""
        self.add_argument(flag, help=text, action="store_true")

    def instance(self) -> None:
        text = "PX4 instance number, added to the default ports (default %(default)s)"
        kind = within(int, "an instance number", 0, 254)
        self.add_argument("-i", "--instance", type=kind, default=0, metavar="N", help=text)

    def vehicle(self) -> None:
        text = "description, as in config/vehicle/"
        self.option("--vehicle", "NAME|FILE", text, DEFAULT_VEHICLE)

    def ports(self) -> None:
        """Add the options of instance, simulator and companion ports."""
        self.instance()
        port = within(int, "a port", 1, 65535)
        self.option("--sim-host", "HOST", "simulator", HOST)
        self.option("--sim-port", "PORT", "simulator (default 4560 + N)", type=port)
        self.option("--mavlink-port", "PORT", "own UDP port (default 14580 + N)", type=port)
        text = "UDP destination until a peer sends a message (default 14540 + N)"
        self.option("--companion-port", "PORT", text, type=port)
        wait = within(float, "a time in seconds", 0.0, 86400.0)
        self.option("--wait", "SECONDS", "longest wait for the simulator", 60.0, type=wait)


def fill_ports(options: argparse.Namespace) -> None:
    """Fill in the instance's default for each port that is not given."""
    n = options.instance
    options.sim_port = options.sim_port or SIMULATOR_TCP + n
    options.mavlink_port = options.mavlink_port or AUTOPILOT_UDP + n
    options.companion_port = options.companion_port or OFFBOARD_UDP + n
