"""OptiTrack by NatNet, over UDP: Motive, or the emulated server.

The server's first answer says whether frames come by multicast or unicast. A server that falls
silent is asked again, so Motive may be started later or restarted.
"""

import ipaddress
import math
import select
import socket
import struct
import time

import numpy as np

from uam_sim_bridge.devices import INSTALL
from uam_sim_bridge.devices.mocap.frame import BodyPose, Frame, MocapError

try:
    from uam_sim_bridge.devices.mocap import natnet_messages as messages
except ImportError:
    messages = None

CONNECT_PERIOD = 0.5  # [s] between two attempts
LIST_PERIOD = 1.0  # [s] between two requests of the list of bodies, and two keep-alives
LIST_RETRY = 0.1  # [s] the same while there is no valid list
SILENCE = 1.5  # [s] without a packet of the server after which it is asked again
LARGEST = 65535  # bytes of a datagram
RECEIVE_BUFFER = 1 << 20  # bytes
STAMPED = 35  # SO_TIMESTAMPNS of Linux: the kernel stamps each datagram at its arrival
_STAMP = struct.Struct("@ll")  # struct timespec
NEVER = -math.inf


class NatNetSource:
    """A `MocapSource`. Multicast is received on the interface with the address `local`."""

    def __init__(self, server: str, port: int = 1510, local: str = "") -> None:
        """server: address or name of Motive's computer; port: its command port.

        local: address of this computer in the tracker's network; "": as routed to the server.
        Raises MocapError.
        """
        if messages is None:
            raise MocapError(f"source natnet needs the package natnet: {INSTALL}")
        try:
            self._server = socket.gethostbyname(server), port
            self._local = local or _route(self._server)
            self._commands = _datagrams(self._local)
        except OSError as error:
            place = f"server {server}" + (f", local {local}" if local else "")
            raise MocapError(f"{place}: {error.strerror or error}") from None
        self._data: socket.socket | None = None
        self._info: messages.ServerInfo | None = None
        self._version = None
        self._names: dict[int, str] | None = None
        self._asked = self._listed = NEVER  # time.monotonic() [s]
        self._heard = NEVER
        self.bad = self.sessions = 0
        self.failure = ""  # why frames or the list of bodies cannot be read

    @property
    def connected(self) -> bool:
        """Whether the server has answered and is not silent."""
        return self._info is not None

    @property
    def names(self) -> tuple[str, ...] | None:
        """Names of the rigid bodies that the server knows; None before its list arrives."""
        return None if self._names is None else tuple(self._names.values())

    @property
    def description(self) -> str:
        """Program, NatNet version and address of the server."""
        if self._info is None:
            return "{}:{}".format(*self._server)
        way = f"multicast {self._info.group}" if self._info.multicast else "unicast"
        version = ".".join(map(str, self._info.version))
        return f"{self._info.application}, NatNet {version}, {way}, {self._server[0]}"

    def frames(self, timeout: float) -> list[Frame]:
        """Return the frames that have arrived; wait at most `timeout` [s] for the first."""
        self._maintain()
        found: list[Frame] = []
        sockets = [one for one in (self._commands, self._data) if one is not None]
        for ready in select.select(sockets, [], [], timeout)[0]:
            if ready.fileno() < 0:  # closed by a packet of the other socket
                continue
            while (received := _receive(ready)) is not None:
                self._take(*received, found)
        return found

    def close(self) -> None:
        self._commands.close()
        if self._data is not None:
            self._data.close()

    def _maintain(self) -> None:
        """Send the requests that are due."""
        now = time.monotonic()
        if self._info is not None and now - self._heard > SILENCE:
            self._info = self._names = None
        if self._info is None:
            if now - self._asked >= CONNECT_PERIOD:
                self._asked = now
                self._send(messages.CONNECT)
        elif now - self._listed >= (LIST_RETRY if self._names is None else LIST_PERIOD):
            self._listed = now
            self._send(messages.REQUEST_MODEL_DEFINITIONS)
            if not self._info.multicast:
                self._send(messages.KEEP_ALIVE)

    def _send(self, message: int) -> None:
        try:
            self._commands.sendto(messages.request(message), self._server)
        except OSError:  # no route for now: sent again when it is due
            pass

    def _take(self, data: bytes, sender: str, arrival: int, found: list[Frame]) -> None:
        """Handle a datagram; packets of other servers in the same group are ignored."""
        if sender != self._server[0] or len(data) < messages.HEADER.size:
            return
        message, size = messages.HEADER.unpack_from(data)
        content = data[messages.HEADER.size :]
        try:
            if size != len(content):
                raise ValueError("cut")
            if message == messages.SERVER_INFO:
                self._heard = time.monotonic()
                if self._info is None:
                    self._join(messages.read_server_info(content))
            elif self._info is None:
                return
            elif message == messages.FRAME:
                self._heard = time.monotonic()
                frame = self._frame(content, arrival)
                if frame is not None:
                    found.append(frame)
            elif message == messages.MODEL_DEFINITIONS:
                self._heard = time.monotonic()
                self._take_models(content)
        except messages.UNREADABLE:
            self.bad += 1
        except OSError as error:  # the group cannot be joined for now: asked again
            self.failure = f"cannot receive the frames: {error.strerror}"

    def _take_models(self, content: bytes) -> None:
        """Read the list of bodies; the old one stays valid if this one cannot be read."""
        try:
            listed = messages.read_models(content, self._version)
        except messages.UNREADABLE as error:
            self.failure = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise
        self._names, self.failure = {one.id_num: one.name for one in listed.rigid_bodies}, ""

    def _join(self, info: messages.ServerInfo) -> None:
        """Begin a session: open the data socket if frames come by multicast."""
        if self._data is not None:
            self._data.close()
            self._data = None
        if info.multicast:
            if not ipaddress.ip_address(info.group).is_multicast:
                raise ValueError(info.group)
            self._data = _datagrams(info.group, info.data_port)
            member = socket.inet_aton(info.group) + socket.inet_aton(self._local)
            self._data.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
        self._info, self._version, self._names = info, messages.Version(*info.version), None
        self.sessions += 1
        self._listed = NEVER
        self._maintain()

    def _frame(self, content: bytes, arrival: int) -> Frame | None:
        """Read a frame; None before the list of bodies has arrived."""
        data = messages.read_frame(content, self._version)
        if data.suffix.tracked_models_changed:  # numbers may belong to other bodies now
            self._names, self._listed = None, NEVER
        if self._names is None:
            return None
        bodies: dict[str, BodyPose | None] = dict.fromkeys(self._names.values())
        for body in data.rigid_bodies:
            name = self._names.get(body.id_num)
            if name is not None:
                bodies[name] = _pose(body.pos, body.rot) if body.tracking_valid else None
        suffix, frequency = data.suffix, self._info.frequency
        if frequency and suffix.stamp_camera_mid_exposure:
            exposed = suffix.stamp_camera_mid_exposure / frequency
            sent = suffix.stamp_transmit / frequency
        else:
            exposed, sent = suffix.timestamp, None
        return Frame(arrival, data.prefix.frame_number, exposed, sent, bodies)


def _pose(position: tuple[float, ...], rotation: tuple[float, ...]) -> BodyPose | None:
    """Return the pose of NatNet's x y z and x y z w; None if it is not usable."""
    at, turned = np.array(position), np.roll(np.array(rotation), 1)
    norm = math.sqrt(turned @ turned)
    if not (math.isfinite(at.sum()) and 0.9 < norm < 1.1):
        return None
    return BodyPose(at, turned / norm)


def _route(server: tuple[str, int]) -> str:
    """Return the own address in the network of the server."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(server)
        return probe.getsockname()[0]


def _datagrams(address: str, port: int = 0) -> socket.socket:
    """Return a UDP socket that does not block, with the kernel's stamps where there are any."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        made.bind((address, port))
    except OSError:
        made.close()
        raise
    made.setblocking(False)
    try:
        made.setsockopt(socket.SOL_SOCKET, STAMPED, 1)
    except OSError:
        pass
    return made


def _receive(source: socket.socket) -> tuple[bytes, str, int] | None:
    """Return a datagram, the address of its sender and its arrival [ns]; None if there is none."""
    try:
        data, extra, _, sender = source.recvmsg(LARGEST, socket.CMSG_SPACE(_STAMP.size))
    except OSError:  # nothing, or a refused port of the server: no Motive on its computer
        return None
    arrival = time.time_ns()
    for level, kind, content in extra:
        if level == socket.SOL_SOCKET and kind == STAMPED and len(content) >= _STAMP.size:
            seconds, nanoseconds = _STAMP.unpack_from(content)
            arrival = seconds * 1_000_000_000 + nanoseconds
    return data, sender[0], arrival
