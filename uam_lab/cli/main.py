"""The command `uam`.

A flight's nodes are forked from a process that takes seconds to load. It starts before this one
loads the command. Ctrl-C is obeyed from here on; `run` of the parser has the commands' own answer.
"""

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence

from uam_lab.executables import interrupt
from uam_lab.flights.processes.interrupts import INTERRUPTED

UTF_8 = "PYTHONUTF8"  # variable of Python
WITHOUT_NODES = {"-h", "--help", "direct", "--engine=direct"}
_early = contextlib.ExitStack()  # ends what began before the command


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    with _ended_by_interrupt():
        from uam_lab.cli import output
        from uam_lab.flights.processes import child, middleware
        from uam_lab.flights.ros import FORKER

        if arguments is None:
            _begin_in_utf_8()
            output.begin()
        os.environ["MPLBACKEND"] = "agg"  # figures are files; a notebook's may be missing here
        given = sys.argv[1:] if arguments is None else arguments
        with_nodes = given[:1] == ["fly"] and not WITHOUT_NODES.intersection(given)
        if with_nodes and not middleware.refusal():
            child.prepare_early([FORKER])
            _early.callback(child.discard)
        with child.blocked(signal.SIGINT):
            import mujoco  # noqa: F401 - its glfw starts a process that Ctrl-C would reach, too
        from uam_lab.cli.parser import parsed, run  # takes a second or two

        options = parsed(given)
    if arguments is None and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
    status = run(options)
    if arguments is None:
        signal.signal(signal.SIGINT, _end)  # the end of the program takes a moment
    return status


def _begin_in_utf_8() -> None:
    """Begin this program again in Python's UTF-8 mode where the locale has another encoding.

    File names, reports and the terminal's text do not depend on the locale then.
    """
    if sys.getfilesystemencoding() != "utf-8" and os.environ.get(UTF_8) != "1":
        os.environ[UTF_8] = "1"
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])


@contextlib.contextmanager
def _ended_by_interrupt() -> Iterator[None]:
    """Let Ctrl-C end this process at once: an import that is interrupted fails in other words."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, _end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _end(*_: object) -> None:
    print("uam: interrupted", file=sys.stderr, flush=True)
    _early.close()
    os._exit(INTERRUPTED)


if __name__ == "__main__":
    sys.exit(main())
