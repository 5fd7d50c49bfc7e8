"""An emulated NatNet server: command and data port, multicast or unicast.

Its owner, a simulation, hands over the poses by `expose`.
"""

import heapq
import math
import select
import socket
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from uam_sim_bridge.devices.mocap.emulated import natnet_packets as packets

GROUP = "239.255.42.99"  # Motive's
CLIENT_TIME = 10.0  # [s] without a packet after which a client gets no more frames by unicast
LONGEST_WAIT = 0.02  # [s]


class Body(Protocol):
    """A rigid body of the server."""

    name: str

    def seen(
        self, position: np.ndarray, quaternion: np.ndarray
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return position x y z [m] and rotation x y z w in the tracker's axes.

        position (3,) [m, ENU] and quaternion (4,) [w x y z], FLU → ENU, of base_link.
        """


@dataclass(frozen=True)
class Streaming:
    """How a server streams."""

    rate: float = 120.0  # [Hz]
    version: tuple[int, int] = (3, 1)  # NatNet's
    multicast: bool = False
    address: str = "127.0.0.1"  # of the server
    port: int = 0  # 0: a free one
    data_port: int = 0  # 0: a free one
    clock: tuple[float, float] = (-1.7e9, 0.0)  # offset [s] and drift of the server's
    latency: float = 0.004  # [s] exposure to transmission


class MocapServer:
    """Serves in a thread of its own; `port`: the command port, `sent`: frames sent."""

    def __init__(self, bodies: Sequence[Body], streaming: Streaming | None = None) -> None:
        """Raises OSError if a port is in use."""
        how = streaming or Streaming()
        if how.version not in packets.VERSIONS:
            raise ValueError(f"version {how.version}; allowed: {packets.VERSIONS}")
        self._bodies = dict(enumerate(bodies, 1))
        self._first = {n: body.name for n, body in self._bodies.items()}  # those of the poses
        self._period, self._version, self._latency = 1.0 / how.rate, how.version, how.latency
        self._multicast, address = how.multicast, how.address
        self._clock = how.clock
        self._commands = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._commands.bind((address, how.port))
        self.port = self._commands.getsockname()[1]
        self._outgoing = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._outgoing.bind((address, 0))
        self._outgoing.setsockopt(
            socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(address)
        )
        free = _free_port(address) if how.multicast else self.port + 1
        self.data_port = how.data_port or free
        self._clients: dict[tuple[str, int], float] = {}  # address → time.monotonic() [s]
        self._lock = threading.Lock()
        self._hidden: set[str] = set()
        self._changed = self._unplugged = False
        self._number = self.sent = 0
        self._seen: dict[int, packets.WireBody] = {}  # as Motive, which repeats the last pose
        self._due: list[tuple[float, int, bytes]] = []  # host's time [s], order, packet
        self._order = 0
        self._exposed = -math.inf  # [s] host's time of the last exposure by `expose`
        self._wake, self._woken = socket.socketpair()
        self._wake.setblocking(False)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """End the server, as when Motive is closed."""
        self._ended.set()
        if self._thread.ident is not None:
            self._thread.join()
        for one in (self._commands, self._outgoing, self._wake, self._woken):
            one.close()

    def occlude(self, name: str, hidden: bool = True) -> None:
        """Hide the markers of a body, or show them again."""
        with self._lock:
            (self._hidden.add if hidden else self._hidden.discard)(name)

    def rename(self, old: str, new: str) -> None:
        """Rename a body, as a person does in Motive; clients are told in the next frame."""
        with self._lock:
            for body in self._bodies.values():
                if body.name == old:
                    body.name = new
            self._changed = True

    def unplug(self, unplugged: bool = True) -> None:
        """Pull the network cable: no packet arrives or leaves."""
        with self._lock:
            self._unplugged = unplugged

    @property
    def state(self) -> tuple[tuple[str, ...], frozenset[str], bool]:
        """Return names of the bodies, the hidden ones, whether unplugged."""
        with self._lock:
            names = tuple(body.name for body in self._bodies.values())
            return names, frozenset(self._hidden), self._unplugged

    def expose(self, host: float, poses: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> bool:
        """Expose at `host` [s], host's clock, if the rate allows it; return whether it does.

        For a simulation that calls this at each of its ticks, in its own thread.
        """
        if host - self._exposed < self._period - 1e-6:
            return False
        # keeps the mean rate where ticks and exposures are no multiples of each other
        late = host - self._exposed - self._period
        self._exposed = host - (late if late < self._period else 0.0)
        self._expose(host, poses)
        try:
            self._wake.send(b"\0")
        except BlockingIOError:  # it is awake
            pass
        return True

    def server_time(self, host: float) -> float:
        """Return the server's clock [s] at the host's time [s]."""
        offset, drift = self._clock
        return (host + offset) * (1.0 + drift)

    def _run(self) -> None:
        while not self._ended.is_set():
            with self._lock:
                self._send_due(time.time())
            left = self._due[0][0] - time.time() if self._due else LONGEST_WAIT
            wait = min(max(left, 0.0), LONGEST_WAIT)
            ready = select.select([self._commands, self._woken], [], [], wait)[0]
            if self._commands in ready:
                self._answer()
            if self._woken in ready:
                self._woken.recv(4096)

    def _answer(self) -> None:
        """Answer a request of a client."""
        try:
            data, client = self._commands.recvfrom(65535)
        except OSError:  # a client that has gone
            return
        if len(data) < 4 or self._unplugged:
            return
        self._clients[client] = time.monotonic()
        message = int.from_bytes(data[:2], "little")
        if message == packets.CONNECT:
            answer = packets.server_info(self._version, self.data_port, self._multicast, GROUP)
        elif message == packets.REQUEST_MODELS:
            with self._lock:
                names = {number: body.name for number, body in self._bodies.items()}
            answer = packets.models(self._version, names)
        elif message == packets.KEEP_ALIVE:
            return
        else:
            answer = packets.packet(packets.UNRECOGNIZED, b"")
        self._commands.sendto(answer, client)

    def _expose(self, now: float, poses: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> None:
        """Make the frame of an exposure at `now` [s], host's clock, and plan its transmission."""
        with self._lock:
            self._number += 1
            for number, body in self._bodies.items():
                pose = None if body.name in self._hidden else poses.get(self._first[number])
                if pose is None:
                    old = self._seen.get(number)
                    at, turned = (old[0], old[1]) if old else ((0.0,) * 3, (0.0, 0.0, 0.0, 1.0))
                else:
                    at, turned = body.seen(*pose)
                self._seen[number] = packets.WireBody(at, turned, pose is not None)
            self._plan(now)

    def _plan(self, now: float) -> None:
        """Plan the transmission of the present frame."""
        sent = now + self._latency
        stamps = packets.Stamps(
            *map(self.server_time, (now, now + 0.3 * self._latency, sent)),
        )
        data = packets.frame(self._version, self._number, stamps, self._seen, self._changed)
        self._changed = False
        self._send_at(sent, data)

    def _send_at(self, due: float, data: bytes) -> None:
        """Send a packet at `due` [s], host's time."""
        self._order += 1
        heapq.heappush(self._due, (due, self._order, data))

    def _send_due(self, now: float) -> None:
        while self._due and self._due[0][0] <= now:
            data = heapq.heappop(self._due)[2]
            if self._unplugged:
                continue
            self.sent += 1
            if self._multicast:
                self._outgoing.sendto(data, (GROUP, self.data_port))
                continue
            oldest = time.monotonic() - CLIENT_TIME
            for client in [one for one, heard in self._clients.items() if heard > oldest]:
                self._commands.sendto(data, client)


def _free_port(address: str) -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((address, 0))
        return probe.getsockname()[1]
