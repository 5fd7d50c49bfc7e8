"""Takes serialized messages with the identity of their publisher, which rclpy leaves out.

rclpy's `take_message` reports stamps and sequence number of a message, but not `publisher_gid`.
This module calls the same function of librcl. The structures are those of rmw/types.h and
rcutils/types/uint8_array.h of ROS 2 Jazzy.
"""

from __future__ import annotations

import ctypes
from ctypes import (
    POINTER,
    c_bool,
    c_int,
    c_int64,
    c_size_t,
    c_uint8,
    c_uint64,
    c_void_p,
)

from rclpy.subscription import Subscription

rcl, rcutils = ctypes.CDLL("librcl.so"), ctypes.CDLL("librcutils.so")  # rclpy has loaded them
OK = 0  # RCL_RET_OK and RMW_RET_OK
GID_SIZE = 16  # RMW_GID_STORAGE_SIZE


class _Allocator(ctypes.Structure):
    _fields_ = [
        (name, c_void_p) for name in ("allocate", "deallocate", "reallocate", "zero", "state")
    ]


class _Bytes(ctypes.Structure):
    _fields_ = [
        ("buffer", c_void_p),
        ("length", c_size_t),
        ("capacity", c_size_t),
        ("allocator", _Allocator),
    ]


class _Info(ctypes.Structure):
    _fields_ = [
        ("source_timestamp", c_int64),
        ("received_timestamp", c_int64),
        ("publication_sequence_number", c_uint64),
        ("reception_sequence_number", c_uint64),
        ("gid_implementation", c_void_p),
        ("gid", c_uint8 * GID_SIZE),
        ("from_intra_process", c_bool),
    ]


_take = rcl.rcl_take_serialized_message
_take.argtypes = [c_void_p, POINTER(_Bytes), POINTER(_Info), c_void_p]
_take.restype = c_int
rcutils.rcutils_get_default_allocator.restype = _Allocator
rcutils.rcutils_uint8_array_fini.argtypes = [POINTER(_Bytes)]


class Taker:
    """Takes the messages of one subscription. `gid` and `info` are those of the last one.

    `gid`: a view of the publisher's identity; compare it with bytes. `info`: times [ns] and
    sequence numbers, as in rmw_message_info_t.
    """

    def __init__(self, subscription: Subscription):
        self._handle = subscription.handle  # keeps the pointer valid
        self.info = _Info()
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

    def take_message(self) -> tuple[bytes, dict[str, int]] | None:
        """Return the next received message and its times; None without one."""
        data = self.take()
        return None if data is None else (data, self.times)

    @property
    def times(self) -> dict[str, int]:
        """Times of the last message [ns], as of rclpy's handle."""
        return {"source_timestamp": self.info.source_timestamp}

    def __del__(self):
        rcutils.rcutils_uint8_array_fini(ctypes.byref(self._data))
