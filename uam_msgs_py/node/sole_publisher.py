"""One publisher per topic of the control loop: messages of any other are refused.

Two publishers of one command would alternate and tumble the vehicle. `rightful` says who may
publish. Where that is the first that sends, it stays once the node works with it: a simulator that
somebody starts must not replace the sensors of a vehicle in the air.

Another one takes over when the rightful one has left the graph, or when it has the same node name
and the rightful one's process is silent: a node that was started again after a crash. A killed
process stays in the graph for many seconds. Silence is that on all guarded topics: some are sent
on change only, and a second node of one name must not take these over in flight.

rclpy's `take_message` reports stamps and sequence number of a message, but not `publisher_gid`.
This module calls the same function of librcl. The structures are those of rmw/types.h and
rcutils/types/uint8_array.h of ROS 2 Jazzy.
"""

import ctypes
import time
from collections import defaultdict, deque
from collections.abc import Callable, Iterable
from ctypes import POINTER, c_bool, c_int, c_int64, c_size_t, c_uint8, c_uint64, c_void_p

from rclpy.node import Node
from rclpy.subscription import Subscription

from uam_msgs_py.messages.tf_message import structure
from uam_msgs_py.node.rightful import Rightful, full_name
from uam_msgs_py.node.wiring import NAMELESS

LOOK_PERIOD = 0.02  # [s] wall time between two looks at the graph
NAME_WAIT = 0.1  # [s] for the node name of a new publisher, which may arrive after its messages
SILENT = 250_000_000  # [ns] wall time after which a publisher of the same name takes over
RARE_SILENT = 5_000_000_000  # [ns] likewise from a process of which only rare messages are read
MANY, MANY_WITHIN = 50, 2_000_000_000  # messages and [ns]: so often is not rare
PROCESS = slice(12)  # the bytes of a gid that are those of the DDS participant
UNKNOWN = "unknown node"
rcl, rcutils = ctypes.CDLL("librcl.so"), ctypes.CDLL("librcutils.so")  # rclpy has loaded them
OK = 0  # RCL_RET_OK and RMW_RET_OK
GID_SIZE = 16  # RMW_GID_STORAGE_SIZE


_Allocator = structure(functions=c_void_p * 4, state=c_void_p)
_Bytes = structure(buffer=c_void_p, length=c_size_t, capacity=c_size_t, allocator=_Allocator)
_Info = structure(
    source_timestamp=c_int64,
    received_timestamp=c_int64,
    publication_sequence_number=c_uint64,
    reception_sequence_number=c_uint64,
    gid_implementation=c_void_p,
    gid=c_uint8 * GID_SIZE,
    from_intra_process=c_bool,
)

_take = rcl.rcl_take_serialized_message
_take.argtypes = [c_void_p, POINTER(_Bytes), POINTER(_Info), c_void_p]
_take.restype = c_int
rcutils.rcutils_get_default_allocator.restype = _Allocator
rcutils.rcutils_uint8_array_fini.argtypes = [POINTER(_Bytes)]


class Taker:
    """Takes the messages of one subscription. `gid` and `info` are those of the last one. `gid` is
    a view of the publisher's identity; compare it with bytes."""

    def __init__(self, subscription: Subscription):
        self._handle = subscription.handle  # keeps the pointer valid
        self.info = _Info()  # times [ns] and sequence numbers, as in rmw_message_info_t
        self.gid = memoryview(self.info).cast("B")[_Info.gid.offset :][:GID_SIZE]
        self._data = _Bytes(allocator=rcutils.rcutils_get_default_allocator())
        self._arguments = (
            c_void_p(subscription.handle.pointer),
            ctypes.byref(self._data),
            ctypes.byref(self.info),
            None,
        )

    def take(self) -> bytes | None:
        """Return the next received message, None without one."""
        if _take(*self._arguments) != OK:
            return None
        return ctypes.string_at(self._data.buffer, self._data.length)

    @property
    def times(self) -> dict[str, int]:
        """Times of the last message [ns], as of rclpy's handle."""
        return {"source_timestamp": self.info.source_timestamp}

    def __del__(self):
        rcutils.rcutils_uint8_array_fini(ctypes.byref(self._data))


class Life:
    """When the newest messages of a process arrived, over all guards of this process."""

    def __init__(self) -> None:
        self._times: deque[int] = deque(maxlen=MANY)
        self.heard = self._times.append  # heard(time [ns]): of the arrival of a message

    def silent(self, now: int) -> bool:
        """Return whether the process has been silent for too long at `now` [ns]."""
        times = self._times
        newest = max(times)  # topics are read one after the other
        often = len(times) == MANY and newest - min(times) < MANY_WITHIN
        return now - newest > (SILENT if often else RARE_SILENT)


_lives: defaultdict[bytes, Life] = defaultdict(Life)  # by PROCESS


class SolePublisher:
    """Takes the messages of one publisher of a subscription, in place of rclpy's handle."""

    def __init__(
        self, node: Node, subscription: Subscription, rightful: Rightful, works: Callable[[], bool]
    ):
        """works: whether the node has worked with the messages."""
        self._node, self._topic, self._works = node, subscription.topic_name, works
        self._expected = rightful
        self.taker = Taker(subscription)
        self._gid = b""  # of the rightful publisher
        self._life = Life()  # of its process
        self._looked = 0.0  # time.monotonic() of the last look at the graph
        self._foreign: dict[bytes, str] = {}  # gid → node name
        self._counts: dict[bytes, int] = {}  # gid → refused messages
        self.rightful = ""  # node name

    def take(self) -> bytes | None:
        """Return the next message of the rightful publisher, serialized; None without one."""
        taker = self.taker
        while (data := taker.take()) is not None:
            if taker.gid == self._gid or self._takes_over():
                self._life.heard(taker.info.received_timestamp)
                return data
        return None

    @property
    def refused(self) -> dict[str, int]:
        """Foreign node → number of its refused messages."""
        found: dict[str, int] = {}
        for gid, count in self._counts.items():
            name = self._foreign.get(gid, UNKNOWN)
            found[name] = found.get(name, 0) + count
        return found

    @property
    def publisher(self) -> str:
        """Name of the rightful node: the one that publishes, else the one that may."""
        return self.rightful or self._expected.name

    def complaint(self) -> str:
        """Return one line about foreign publishers, "" without any."""
        refused = self.refused
        if not refused:
            return ""
        names = ", ".join(f"{name} ({count} messages)" for name, count in refused.items())
        absent = "" if self.rightful else ", which is not there (parameter publishers: another)"
        return f"{self._topic}: refused {names}; publisher is {self.publisher}{absent}"

    def _takes_over(self) -> bool:
        """Return whether the publisher of the last message becomes the rightful one."""
        gid, now = bytes(self.taker.gid), time.monotonic()
        if gid not in self._counts or now - self._looked >= LOOK_PERIOD:
            self._looked = now
            names = self._named_publishers(gid)
            if self._may(gid, names):
                self._gid, self.rightful = gid, names.get(gid, UNKNOWN)
                self._life = _lives[gid[PROCESS]]
                self._counts.pop(gid, None)
                return True
            if gid in names:
                self._foreign[gid] = names[gid]
        self._counts[gid] = self._counts.get(gid, 0) + 1
        return False

    def _may(self, gid: bytes, names: dict[bytes, str]) -> bool:
        name, expected = names.get(gid, UNKNOWN), self._expected
        if self._gid in names:  # the rightful one is there
            if name == self.rightful:
                return self._life.silent(self.taker.info.received_timestamp)
            return name == expected.name and not self._works()
        return name == expected.name or not (expected.only or expected.name in names.values())

    def _named_publishers(self, gid: bytes) -> dict[bytes, str]:
        """Return `publishers`; before the node works wait until the name of `gid` is there.

        A latched message is sent once: it must not be refused for a name that comes later.
        """
        names = publishers(self._node, self._topic)
        end = time.monotonic() + NAME_WAIT
        while gid not in names and gid not in self._counts and not self._works():
            if time.monotonic() > end:
                break
            time.sleep(NAME_WAIT / 50.0)
            names = publishers(self._node, self._topic)
        return names


def publishers(node: Node, topic: str) -> dict[bytes, str]:
    """Return the publishers of a topic (absolute name) in the graph: gid → full node name."""
    return {
        bytes(end.endpoint_gid): full_name(end.node_namespace, end.node_name)
        for end in node.get_publishers_info_by_topic(topic)
        if end.node_name != NAMELESS
    }


def complaints(guards: Iterable[SolePublisher]) -> list[str]:
    """Return one line per topic with foreign publishers."""
    return [text for guard in guards if (text := guard.complaint())]
