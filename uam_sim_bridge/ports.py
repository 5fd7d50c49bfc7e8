"""Reserves an instance number for each flight, so that parallel flights share no port or domain.

Instance N uses ROS domain FIRST_DOMAIN + N and the ports of PX4's instance N (px4_sitl -i N):
TCP 4560 + N for the simulator link, UDP 14540 + N (offboard side) and 14580 + N (autopilot side).
"""

import errno
import fcntl
import os
import socket
import stat
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

SIMULATOR_TCP, OFFBOARD_UDP, AUTOPILOT_UDP = 4560, 14540, 14580  # PX4's own, instance 0
FIRST_DOMAIN = 1  # domain 0 is the default of all ROS programs
LAST_DOMAIN = 101  # above it the middleware's ports overlap the system's ephemeral ports
KINDS = {"TCP": socket.SOCK_STREAM, "UDP": socket.SOCK_DGRAM}
INSTANCES = min(LAST_DOMAIN - FIRST_DOMAIN + 1, AUTOPILOT_UDP - OFFBOARD_UDP)


class PortError(ValueError):
    """A port, link or instance is not available; the text is one line for the user."""


@dataclass(frozen=True)
class Ports:
    """Instance number, ROS domain and ports of one flight. All ports are on 127.0.0.1."""

    instance: int
    domain: int
    simulator_tcp: int
    offboard_udp: int
    autopilot_udp: int


def ports_of(instance: int) -> Ports:
    """Return the ports of an instance; raises PortError outside 0..INSTANCES - 1."""
    if not 0 <= instance < INSTANCES:
        raise PortError(f"instance {instance} is not in 0..{INSTANCES - 1}")
    return Ports(
        instance,
        FIRST_DOMAIN + instance,
        SIMULATOR_TCP + instance,
        OFFBOARD_UDP + instance,
        AUTOPILOT_UDP + instance,
    )


def in_use(kind: int, port: int) -> bool:
    """Return whether `port` of 127.0.0.1 cannot be bound; kind: SOCK_STREAM or SOCK_DGRAM."""
    with socket.socket(socket.AF_INET, kind) as probe:
        if kind == socket.SOCK_STREAM:  # ignore TIME_WAIT of a closed connection
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            if error.errno in (errno.EADDRINUSE, errno.EACCES):
                return True
            raise
    return False


def bound(protocol: str, host: str, port: int, purpose: str) -> socket.socket:
    """Return a socket at a port of this machine; one of TCP listens.

    purpose: what the port is for. Raises PortError in one line if the port is in use.
    """
    opened = socket.socket(socket.AF_INET, KINDS[protocol])
    try:
        if protocol == "TCP":
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.bind((host, port))
        if protocol == "TCP":
            opened.listen(1)
    except (OSError, OverflowError) as error:
        opened.close()
        reason = getattr(error, "strerror", None) or str(error)
        raise PortError(
            f"{protocol} port {port} for {purpose}: {reason}; stop the program that uses it or "
            "choose another instance"
        ) from None
    return opened


def serial_problem(error: Exception) -> str:
    """Return why a serial device cannot be used, from an error of pyserial or termios."""
    number = getattr(error, "errno", None) or next(iter(error.args), None)
    known = {
        errno.ENOENT: "does not exist",
        errno.EACCES: "no permission; add the user to the group dialout",
        errno.EWOULDBLOCK: "in use by another program",
    }
    if isinstance(number, int):
        return known.get(number) or os.strerror(number)
    return " ".join(str(error).split())


def is_discovery_port(port: int) -> bool:
    """Return whether a port of the middleware is a discovery port (RTPS 2.2, 9.6.1.1): even."""
    return port % 2 == 0


class RunningFlight(NamedTuple):
    """A flight of `uam fly` that runs; namespace: of its nodes, as `/uav1`."""

    instance: int
    domain: int
    namespace: str


class BusyPort(NamedTuple):
    """A port that another program holds; protocol: TCP or UDP."""

    protocol: str
    number: int
    purpose: str

    def __str__(self) -> str:
        return f"{self.protocol} {self.number} ({self.purpose})"


def busy_port(ports: Ports, own_autopilot: bool = True) -> BusyPort | None:
    """Return the first port of an instance that another program holds; None if all are free.

    own_autopilot: the flight starts the autopilot, so the autopilot's port must be free as well.
    """
    required = [
        BusyPort("TCP", ports.simulator_tcp, "simulator link"),
        BusyPort("UDP", ports.offboard_udp, "offboard link"),
    ]
    if own_autopilot:
        required.append(BusyPort("UDP", ports.autopilot_udp, "autopilot"))
    return next((one for one in required if in_use(KINDS[one.protocol], one.number)), None)


def instances_in_use(folder: Path | None = None) -> list[int]:
    """Return the instances that flights of this user have reserved."""
    return [number for number in range(INSTANCES) if held(lock_file(folder, number))]


def held(lock: Path) -> bool:
    """Return whether a process holds the lock; False for a missing or unlocked file."""
    try:
        opened = os.open(lock, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        fcntl.flock(opened, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(opened)
    return False


def lock_file(folder: Path | None, instance: int) -> Path:
    """Return the lock file of an instance; folder: None for the system's temporary folder."""
    return (folder or Path(tempfile.gettempdir())) / f"uam-{os.getuid()}-{instance}.lock"


class Reservation:
    """Reserves one instance until `release`. A context manager.

    The lock is a flock on <folder>/uam-<user>-<N>.lock. The system releases it when its process
    ends, so a crashed flight leaves the instance free.
    """

    def __init__(
        self,
        instance: int | None = None,
        folder: Path | None = None,
        own_autopilot: bool = True,
        domain: int | None = None,
        namespace: str = "/",
    ):
        """Reserve `instance`, or the first free one; folder: of the locks, see `lock_file`.

        own_autopilot: see `busy_port`; domain: None for that of the instance; namespace: of the
        flight's nodes. Raises PortError if the instance, or every one, is in use, or if another
        flight has this namespace in the domain.
        """
        self._folder = folder or Path(tempfile.gettempdir())
        self._lock: int | None = None
        candidates = range(INSTANCES) if instance is None else [instance]
        why = ""
        for number in candidates:
            ports = ports_of(number)
            try:
                self._lock = self._take(self._path(number))
            except OSError as error:
                why = f"{self._path(number)} is no lock: {error.strerror}; remove it"
                continue
            if self._lock is None:
                why = "reserved by another flight"
                continue
            busy = busy_port(ports, own_autopilot)
            if busy is None:
                self.ports = ports if domain is None else replace(ports, domain=domain)
                self._claim(namespace)
                return
            why = f"{busy} is in use by another program"
            self._drop(self._path(number))
        if instance is not None:
            raise PortError(f"instance {instance} is not free: {why}")
        raise PortError(f"none of the {INSTANCES} instances is free; the last one: {why}")

    def _claim(self, namespace: str) -> None:
        """Write domain and namespace to the lock file, where no other flight has both."""
        own = self.ports
        for other in flights(self._folder):
            if other.instance != own.instance and (other.domain, other.namespace) == (
                own.domain,
                namespace,
            ):
                self.release()
                raise PortError(
                    f"instance {other.instance} flies in namespace {namespace} of ROS domain "
                    f"{own.domain} already: give another --namespace, or no --domain"
                )
        os.ftruncate(self._lock, 0)
        os.write(self._lock, f"{own.domain} {namespace}".encode())

    def _path(self, instance: int) -> Path:
        return lock_file(self._folder, instance)

    @staticmethod
    def _take(path: Path) -> int | None:
        """Return the descriptor of the lock, None if another flight has it.

        Raises OSError for something else in its place: a folder, a link, a file of another user.
        """
        flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
        lock = os.open(path, flags, 0o600)
        if not stat.S_ISREG(os.fstat(lock).st_mode):
            os.close(lock)
            raise OSError(errno.EINVAL, "no regular file")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # the last holder may have removed the file between open and flock
            if os.stat(path).st_ino == os.fstat(lock).st_ino:
                return lock
        except OSError:
            pass
        os.close(lock)
        return None

    def _drop(self, path: Path) -> None:
        if self._lock is not None:
            path.unlink(missing_ok=True)
            os.close(self._lock)
            self._lock = None

    def release(self) -> None:
        """Release the instance and remove its lock file."""
        self._drop(self._path(self.ports.instance))

    def __enter__(self) -> "Reservation":
        return self

    def __exit__(self, *exception: object) -> None:
        self.release()


def flights(folder: Path | None = None) -> list[RunningFlight]:
    """Return the running flights of this user, by instance; folder: see `lock_file`."""
    found = []
    for instance in instances_in_use(folder):
        try:
            domain, namespace = lock_file(folder, instance).read_text(encoding="utf-8").split()
        except (OSError, ValueError):  # it has just ended, or has not written it yet
            domain, namespace = ports_of(instance).domain, "/"
        found.append(RunningFlight(instance, int(domain), namespace))
    return found


def flight_of(
    instance: int | None,
    namespace: str = "",
    folder: Path | None = None,
    domain: int | None = None,
) -> RunningFlight | None:
    """Return the flight `instance`, else that in `namespace`, else the only one that runs.

    namespace: in the form of ROS, "" for any; domain: that of the flight, if the user has set
    ROS_DOMAIN_ID. Returns None without such a flight: the environment's domain applies. Raises
    PortError if several flights are possible.
    """
    running = flights(folder)
    if instance is not None:
        missing = RunningFlight(instance, ports_of(instance).domain, namespace or "/")
        return next((one for one in running if one.instance == instance), missing)
    possible = [
        one for one in running if namespace in ("", one.namespace) and domain in (None, one.domain)
    ]
    if len(possible) > 1:
        numbers = ", ".join(f"{one.instance}: {one.namespace}" for one in possible)
        raise PortError(
            f"several flights are running: choose one by --instance or --namespace ({numbers})"
        )
    return possible[0] if possible else None
