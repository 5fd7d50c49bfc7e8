"""How a node runs inside a flight: forked where its imports are done, ended with the flight.

A node needs seconds to import what it uses, the same for all of them. So they are forked from one
process that has imported it (multiprocessing's fork server, see `prepare`): a flight starts sooner,
and a node that was lost in flight is back sooner.

Each child watches its orchestrator. When that is gone - even by `kill -9`, which no handler sees -
it is interrupted as by Ctrl-C, and killed if that does not help. Unlike PR_SET_PDEATHSIG this works
on every system and lets the recorder close its file.
"""

from __future__ import annotations

import importlib
import multiprocessing
import multiprocessing.connection
import multiprocessing.forkserver
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from setproctitle import setproctitle

GRACE = 5.0  # seconds from the interrupt to the kill, once the orchestrator is gone
TITLE = "uam-node"  # how the command line of a child begins, for `ps` and `process_table`
POLL = 0.002  # seconds
# One thread each: the nodes' matrices are tiny, and pools of threads on few cores only delay each
# other. Read when the libraries are loaded, hence by the process that forks.
SINGLE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")

_context = multiprocessing.get_context("forkserver")


def prepare(modules: Iterable[str]) -> None:
    """Start the process that forks, and have it import `modules`; returns at once.

    Without it the first child starts that process, and every child imports for itself.
    """
    before = {name: os.environ.get(name) for name in SINGLE_THREAD}
    os.environ.update(SINGLE_THREAD)
    try:
        _context.set_forkserver_preload([__name__, *modules])
        multiprocessing.forkserver.ensure_running()
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


class Forked:
    """A running child, with what `subprocess.Popen` calls the same."""

    def __init__(
        self,
        name: str,
        module: str,
        arguments: Sequence[str],
        log: Path,
        environment: Mapping[str, str],
    ) -> None:
        """See `Processes.start`; log: output is appended to it."""
        run = (name, module, tuple(arguments), str(log), dict(environment))
        self._process = _context.Process(target=_run, args=run, name=name)
        self._process.start()
        while self.returncode is None and not self._apart():
            time.sleep(POLL)

    def _apart(self) -> bool:
        """Whether Ctrl-C in the terminal does not reach it any more."""
        try:
            return os.getpgid(self.pid) == self.pid
        except ProcessLookupError:  # ended; its status is on its way
            return False

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        """None while it runs; negative: the signal that ended it."""
        return self._process.exitcode

    def poll(self) -> int | None:
        """The same."""
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Send it, unless it has ended."""
        if self.returncode is None:
            os.kill(self.pid, number)


def _run(
    name: str,
    module: str,
    arguments: tuple[str, ...],
    log: str,
    environment: dict[str, str],
) -> None:
    """Be the child: import the module and call its `main()`, which reads sys.argv."""
    os.setpgid(0, 0)  # Ctrl-C in the terminal is for the orchestrator alone
    setproctitle(f"{TITLE} {name}")  # before the environment changes, beside which the title lies
    with open(log, "ab", buffering=0) as output:
        for stream in (1, 2):
            os.dup2(output.fileno(), stream)
    sys.stdout = os.fdopen(1, "w", buffering=1, closefd=False)
    sys.stderr = os.fdopen(2, "w", buffering=1, closefd=False)
    os.environ.clear()
    os.environ.update(environment)
    added = environment.get("PYTHONPATH", "").split(os.pathsep)
    sys.path[:0] = [place for place in added if place and place not in sys.path]
    threading.Thread(target=_follow_the_orchestrator, daemon=True).start()
    sys.argv = [module, *arguments]
    try:
        status = importlib.import_module(module).main()
    except Exception:  # said here, as multiprocessing adds its own lines
        traceback.print_exc()
        status = 1
    sys.exit(status)


def _follow_the_orchestrator() -> None:
    multiprocessing.connection.wait([multiprocessing.parent_process().sentinel])
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(GRACE)
    os.kill(os.getpid(), signal.SIGKILL)
