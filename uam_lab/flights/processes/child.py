"""A node's process in a flight: forked from a process with finished imports.

The imports of a node take seconds and are the same for all nodes. The nodes are therefore forked
from one process that has imported the modules (multiprocessing's fork server, see `prepare`). This
shortens the start of a flight and the restart of a lost node.

Each child monitors its orchestrator. When the orchestrator has ended, also by `kill -9`, the child
sends itself SIGINT, and SIGKILL after GRACE. Unlike PR_SET_PDEATHSIG with SIGKILL this works on
every system and lets the recorder close its file.
"""

import atexit
import contextlib
import ctypes
import importlib
import multiprocessing
import multiprocessing.connection
import multiprocessing.forkserver
import multiprocessing.resource_tracker
import multiprocessing.spawn
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Iterable, Iterator, Mapping, Sequence
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from setproctitle import setproctitle

GRACE = 5.0  # [s] from SIGINT to SIGKILL, after the end of the orchestrator
TITLE = "uam-node"  # first word of a child's command line, for `ps` and `process_table`
POLL = 0.002  # seconds
PR_SET_PDEATHSIG = 1  # linux/prctl.h
# One thread per node: the matrices are small, and thread pools on few cores delay each other. The
# libraries read these variables when they are loaded, so the forking process needs them.
SINGLE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")

_context = multiprocessing.get_context("forkserver")
_preparation_data = multiprocessing.spawn.get_preparation_data
_lock = threading.RLock()


def copied() -> dict[str, str]:
    """Return a copy of the variables, without the changes of `borrowed` in other threads."""
    with _lock:
        return dict(os.environ)


@contextlib.contextmanager
def borrowed(environment: Mapping[str, str]) -> Iterator[None]:
    """Set these variables within the `with` block, in one thread at a time.

    Several flights of one program run in threads. ROS and the numerical libraries read some
    variables when they start.
    """
    with _lock:
        before = {name: os.environ.get(name) for name in environment}
        os.environ.update(environment)
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    os.environ.pop(name, None)
                else:
                    os.environ[name] = value


@contextlib.contextmanager
def blocked(*signals: int) -> Iterator[None]:
    """Let signals wait within the `with` block; they do not reach processes and threads that start
    in it: Ctrl-C in the terminal is sent to all processes of the command."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _without_main(name: str) -> dict[str, Any]:
    """Return what a child process is prepared by; a node does not import the user's program.

    Otherwise every node would run again a script that starts a flight.
    """
    data = _preparation_data(name)
    if name.startswith(f"{TITLE} "):
        data.pop("init_main_from_name", None)
        data.pop("init_main_from_path", None)
    return data


multiprocessing.spawn.get_preparation_data = _without_main


def prepare(modules: Iterable[str]) -> None:
    """Start the forking process, which imports `modules`; return at once.

    Without this call the first child starts that process, and each child does its own imports.
    Ctrl-C in the terminal does not interrupt its imports; a closed terminal does not end it.
    """
    with borrowed(SINGLE_THREAD):
        _context.set_forkserver_preload([__name__, *modules])
        multiprocessing.resource_tracker.ensure_running()  # its start unblocks the signal
        with blocked(signal.SIGINT, signal.SIGHUP):
            multiprocessing.forkserver.ensure_running()


def prepare_early(modules: Iterable[str]) -> None:
    """Start the forking process as `prepare` does, before it is known whether it is needed.

    At the end of this process it ends, too, though it may still be loading.
    """
    prepare(modules)
    atexit.register(discard)


def discard() -> None:
    """End the forking process, if there is one; no child of it may run."""
    pid = multiprocessing.forkserver._forkserver._forkserver_pid
    if pid is not None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def fork(
    name: str, module: str, arguments: Sequence[str], log: Path, environment: Mapping[str, str]
) -> BaseProcess:
    """Start a child, see `Processes.start`; log: file to which its output is appended."""
    run = (name, module, tuple(arguments), str(log), dict(environment))
    process = _context.Process(target=_run, args=run, name=f"{TITLE} {name}")
    process.start()
    while process.exitcode is None and not _apart(process.pid):
        time.sleep(POLL)
    return process


def _apart(pid: int) -> bool:
    """Return whether a child has its own process group, so Ctrl-C does not reach it."""
    try:
        return os.getpgid(pid) == pid
    except ProcessLookupError:  # ended; its status follows
        return False


def obey_interrupts() -> None:
    """Let SIGINT act again, see `prepare`; one that has waited was the orchestrator's."""
    signal.signal(signal.SIGINT, signal.signal(signal.SIGINT, signal.SIG_IGN))
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def _run(
    name: str,
    module: str,
    arguments: tuple[str, ...],
    log: str,
    environment: dict[str, str],
) -> None:
    """Main function of the child: import the module and call its `main()`, which reads sys.argv."""
    os.setpgid(0, 0)  # Ctrl-C in the terminal reaches only the orchestrator
    obey_interrupts()
    setproctitle(f"{TITLE} {name}")  # before a change of the environment, next to it in memory
    with open(log, "ab", buffering=0) as output:
        for stream in (1, 2):
            os.dup2(output.fileno(), stream)
    sys.stdout = os.fdopen(1, "w", buffering=1, closefd=False, encoding="utf-8")
    sys.stderr = os.fdopen(2, "w", buffering=1, closefd=False, encoding="utf-8")
    os.environ.clear()
    os.environ.update(environment)
    added = environment.get("PYTHONPATH", "").split(os.pathsep)
    sys.path[:0] = [place for place in added if place and place not in sys.path]
    _continue_without_the_orchestrator()
    threading.Thread(target=_follow_the_orchestrator, daemon=True).start()
    sys.argv = [module, *arguments]
    try:
        status = importlib.import_module(module).main()
    except Exception:  # printed here, because multiprocessing would add its own lines
        traceback.print_exc()
        status = 1
    sys.exit(status)


def _continue_without_the_orchestrator() -> None:
    """Have Linux send SIGCONT at the end of the forking process, which ends with the orchestrator.

    A process that is stopped could not follow it, and would keep its ports.
    """
    server = multiprocessing.forkserver._forkserver
    if server._forkserver_alive_fd is not None:  # while a child has it, that process does not end
        os.close(server._forkserver_alive_fd)
        server._forkserver_alive_fd = None
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGCONT, 0, 0, 0)


def _follow_the_orchestrator() -> None:
    multiprocessing.connection.wait([multiprocessing.parent_process().sentinel])
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(GRACE)
    os.kill(os.getpid(), signal.SIGKILL)
