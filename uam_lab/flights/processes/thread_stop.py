"""Stops single threads of a child process by ptrace, as a debugger does (Linux, see ptrace(2)).

Signals stop whole processes only. The kernel continues the threads when the tracer ends, also after
a crash. A traced process can be killed and interrupted as usual.
"""

import contextlib
import ctypes
import os
from collections.abc import Callable
from pathlib import Path

SEIZE, INTERRUPT, DETACH = 0x4206, 0x4207, 17  # sys/ptrace.h
WAIT_ALL = 0x40000000  # __WALL, for threads as well
SCOPE = Path("/proc/sys/kernel/yama/ptrace_scope")
ADMINISTRATOR_ONLY = 2

_ptrace = ctypes.CDLL(None, use_errno=True).ptrace
_ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
_ptrace.restype = ctypes.c_long


def refusal() -> str:
    """Return why threads of children cannot be stopped on this machine, "" if they can."""
    try:
        scope = int(SCOPE.read_text(encoding="utf-8"))
    except (OSError, ValueError):  # a kernel without Yama
        return ""
    if scope >= ADMINISTRATOR_ONLY and os.geteuid() != 0:
        return f"kernel.yama.ptrace_scope is {scope}; it must be 1 or less"
    return ""


class StoppedThreads:
    """Threads of a process, chosen by their names, stopped until `end`."""

    def __init__(self, pid: int, chosen: Callable[[str], bool]):
        """Stop the threads. Only the same thread may call `end` (a rule of ptrace).

        Raises OSError if the kernel refuses.
        """
        self._stopped: list[int] = []
        for task in Path(f"/proc/{pid}/task").iterdir():
            with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # it has just ended
                if chosen((task / "comm").read_text(encoding="utf-8").strip()):
                    self._stop(int(task.name))

    def _stop(self, thread: int) -> None:
        _call(SEIZE, thread)
        self._stopped.append(thread)
        _call(INTERRUPT, thread)
        os.waitpid(thread, WAIT_ALL)

    def look(self) -> None:
        """Collect ended threads; their process stays a zombie until then."""
        for thread in self._stopped:
            with contextlib.suppress(OSError):
                os.waitpid(thread, WAIT_ALL | os.WNOHANG)

    def end(self) -> None:
        """Let the threads continue."""
        self.look()
        for thread in self._stopped:
            with contextlib.suppress(OSError):  # ended meanwhile
                _call(DETACH, thread)
        self._stopped.clear()


def _call(request: int, thread: int) -> None:
    if _ptrace(request, thread, None, None) == -1:
        number = ctypes.get_errno()
        raise OSError(number, f"ptrace of thread {thread}: {os.strerror(number)}")
