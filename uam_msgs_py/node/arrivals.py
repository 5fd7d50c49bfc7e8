"""Which services have a request, told by the middleware: nobody has to ask them one by one.

Asking takes a microsecond or two for each service, and a process of several nodes has seventy: five
per cent of its time. librcl calls a function at each request, from a thread of the middleware that
must not wait for Python's lock. The function is therefore machine code: it sets a byte. The bytes
are never freed, because the thread may end after them.

rcl_event_callback_t: void (const void * user_data, size_t number_of_events), rcl/event_callback.h
of ROS 2 Jazzy. Where functions are not compiled (`uam_control.maths.compiled`), or the middleware
cannot tell, every service is asked.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Sequence
from functools import cache

from rclpy.service import Service

from uam_control.maths import compiled
from uam_control.maths.assembly import machine_code
from uam_msgs_py.node.librcl import OK, rcl

_NAME = "uam_note_arrival"
_NOTE = f"""
define void @{_NAME}(ptr %flag, i64 %count) {{
  store atomic i8 1, ptr %flag release, align 1
  ret void
}}
"""
SET, CLEAR = b"\1", b"\0"
_kept: list[object] = []  # bytes that the middleware may still set

_tell = rcl.rcl_service_set_on_new_request_callback
_tell.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
_tell.restype = ctypes.c_int


@cache
def _note() -> int | None:
    """Return the address of the function that sets a byte; None where nothing is compiled."""
    return machine_code(_NOTE, _NAME) if compiled.active() else None


class Arrivals:
    """The services of a process that may have a request; at first all of them."""

    def __init__(self) -> None:
        self._services: list[Service] = []
        self._flags = ctypes.create_string_buffer(1)
        self._told: list[bool] = []  # by the middleware

    def watch(self, services: Sequence[Service]) -> None:
        """Watch these services from now on, and no others; no effect if they are the same."""
        if services == self._services:
            return
        self._services = list(services)
        self._flags = ctypes.create_string_buffer(SET * len(services), len(services) + 1)
        _kept.append(self._flags)
        first, note = ctypes.addressof(self._flags), _note()
        self._told = [
            note is not None and _tell(service.handle.pointer, note, first + at) == OK
            for at, service in enumerate(services)
        ]

    def waiting(self) -> Iterator[Service]:
        """Yield each service that may have a request it has not been yielded for."""
        flags, at = self._flags, -1
        while (at := flags.raw.find(SET, at + 1)) >= 0:
            if self._told[at]:
                flags[at] = CLEAR  # before the caller takes one: the next may come meanwhile
            yield self._services[at]

    def ask_all(self) -> None:
        """Yield every service once: a command must arrive even if nobody has told of it."""
        self._flags[: len(self._services)] = SET * len(self._services)

    def more(self, service: Service) -> None:
        """Yield a service again: it had a request, and may have another one."""
        self._flags[self._services.index(service)] = SET
