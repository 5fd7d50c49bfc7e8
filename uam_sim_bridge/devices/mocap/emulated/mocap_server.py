"""An emulated NatNet server: command and data port, multicast or unicast, and its disturbances.

    with MocapServer([body], poses) as server:
        server.occlude("uam")

`poses(time)` returns name → (position (3,) [m, ENU], quaternion (4,) FLU → ENU) of the vehicle at
`time` [s] of the host's clock, time.time(); a body without a pose is not tracked. Without `poses`
the owner, a simulation, hands them over by `expose`.
"""

import heapq
import math
import random
import select
import socket
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from uam_sim_bridge.devices.mocap.emulated import natnet_packets as packets

Poses = Callable[[float], Mapping[str, tuple[np.ndarray, np.ndarray]]]
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


@dataclass
class Disturbances:
    """What happens to frames; may be changed while the server runs.

    latency [s]: exposure to transmission; jitter [s]: mean of the delay after that, exponential;
    loss, repeat, swap: probability per frame that it is lost, sent twice, or overtaken by the next;
    damage: that a byte of it is changed.
    """

    latency: float = 0.004
    jitter: float = 0.0
    loss: float = 0.0
    repeat: float = 0.0
    swap: float = 0.0
    damage: float = 0.0


@dataclass(frozen=True)
class Streaming:
    """How a server streams.

    rate [Hz]; version: NatNet's; address: of the server; port, data_port: 0 for free ones; clock:
    offset [s] and drift of the server's.
    """

    rate: float = 120.0
    version: tuple[int, int] = (3, 1)
    multicast: bool = False
    address: str = "127.0.0.1"
    port: int = 0
    data_port: int = 0
    clock: tuple[float, float] = (-1.7e9, 0.0)


class MocapServer:
    """Serves in a thread of its own; `port`: the command port, `sent`: frames sent."""

    def __init__(
        self,
        bodies: Sequence[Body],
        poses: Poses | None = None,
        streaming: Streaming | None = None,
        disturbances: Disturbances | None = None,
        seed: int = 0,
    ) -> None:
        """seed: of the disturbances. Raises OSError if a port is in use."""
        how = streaming or Streaming()
        if how.version not in packets.VERSIONS:
            raise ValueError(f"version {how.version}; allowed: {packets.VERSIONS}")
        self.disturbances = disturbances or Disturbances()
        self._bodies = dict(enumerate(bodies, 1))
        self._first = {n: body.name for n, body in self._bodies.items()}  # those of `poses`
        self._poses, self._period, self._version = poses, 1.0 / how.rate, how.version
        self._multicast, address = how.multicast, how.address
        self._clock, self._random = how.clock, random.Random(seed)
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
        self._changed = self._paused = self._unplugged = False
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
        """Begin to serve."""
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

    def remove(self, name: str) -> None:
        """Delete a body."""
        with self._lock:
            self._bodies = {n: body for n, body in self._bodies.items() if body.name != name}
            self._seen.clear()
            self._changed = True

    def pause(self, paused: bool = True) -> None:
        """Stop the frames, not the server."""
        with self._lock:
            self._paused = paused

    def unplug(self, unplugged: bool = True) -> None:
        """Pull the network cable: no packet arrives or leaves."""
        with self._lock:
            self._unplugged = unplugged

    @property
    def state(self) -> tuple[tuple[str, ...], frozenset[str], bool, bool]:
        """Return names of the bodies, the hidden ones, whether paused, whether unplugged."""
        with self._lock:
            names = tuple(body.name for body in self._bodies.values())
            return names, frozenset(self._hidden), self._paused, self._unplugged

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
        due = math.inf if self._poses is None else time.time()
        while not self._ended.is_set():
            now = time.time()
            if now >= due:
                due = max(due + self._period, now - self._period)
                self._expose(now, self._poses(now))
            with self._lock:
                self._send_due(now)
            soonest = min(due, self._due[0][0] if self._due else due)
            wait = min(max(soonest - time.time(), 0.0), LONGEST_WAIT)
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
            if self._paused:
                return
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
        """Plan the transmission of the present frame, with what happens to it."""
        d, chance = self.disturbances, self._random.random
        sent = now + d.latency
        stamps = packets.Stamps(
            *map(self.server_time, (now, now + 0.3 * d.latency, sent)),
        )
        data = packets.frame(self._version, self._number, stamps, self._seen, self._changed)
        self._changed = False
        if chance() < d.damage:
            at = self._random.randrange(4, len(data))
            data = data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :]
        if chance() < d.loss:
            return
        arrival = sent + (self._random.expovariate(1.0 / d.jitter) if d.jitter else 0.0)
        if chance() < d.swap:
            arrival += 1.5 * self._period
        for _ in range(2 if chance() < d.repeat else 1):
            self._order += 1
            heapq.heappush(self._due, (arrival, self._order, data))

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
