"""Starts, watches and stops the processes of one flight.

Each child has its own process group: Ctrl-C in the terminal reaches only the orchestrator, which
stops the children in order. The output of a child goes to <logs>/<name>.log. The children stay in
the session, because schedulers share processor time between sessions first. See also `child`.
"""

import contextlib
import os
import re
import signal
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from pathlib import Path

import psutil

from uam_lab.flights.processes.child import fork

LAST_LINES = 12  # of a failed node's log that its error message shows
INTERRUPT_WAIT, TERMINATE_WAIT = 10.0, 3.0  # seconds until the next, harder signal
POLL = 0.02  # seconds


class NodeFailed(RuntimeError):
    """A process of the flight ended by itself; the text contains its name and the reason."""

    def __init__(self, name: str, status: int | None, log: Path):
        """status: None for a process that is stopped, see `Processes.stopped`."""
        self.name, self.status = name, status
        self.last_lines = tail(log)
        own_words = self.last_lines[-1] if self.last_lines else ""
        # prefix of a node's last line, or of a line that it logs by rclpy
        why = re.sub(rf"^({name}: |\[\w+\] \[[\d.]+\] \[{name}\]: )", "", own_words)
        ended = status is not None and status >= 0
        said = f": {why}" if ended and why != own_words else ""  # a killed one gave none
        super().__init__(f"{name} {describe(status)}{said}")


def describe(status: int | None) -> str:
    """Return a return code of subprocess as text."""
    if status is None:
        return "is stopped (SIGSTOP) and does not go on"
    if status < 0:
        try:
            return f"was killed by {signal.Signals(-status).name}"
        except ValueError:
            return f"was killed by signal {-status}"
    return f"ended by itself with exit status {status}"


def tail(log: Path) -> list[str]:
    """Return the last non-empty lines of a text file; none if it does not exist."""
    try:
        with log.open("rb") as file:
            file.seek(max(0, log.stat().st_size - 16384))
            text = file.read().decode(errors="replace")
    except OSError:
        return []
    return [line for line in text.splitlines() if line.strip()][-LAST_LINES:]


def _is_stopped(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() in (psutil.STATUS_STOPPED, psutil.STATUS_TRACING_STOP)
    except psutil.Error:  # it ends at this moment
        return False


@dataclass
class NodeProcess:
    """One running process."""

    name: str
    process: BaseProcess
    log: Path
    run: Callable[[Sequence[str]], BaseProcess]  # restarts it, with additional arguments
    may_end: bool = False  # its end is expected: after a stop or with the mission
    optional: bool = False  # the flight continues without it
    again: int = 0  # remaining number of restarts
    nodes: tuple[str, ...] = ()  # its nodes, where they have other names

    @property
    def status(self) -> int | None:
        """Exit status, None while it runs; negative: the signal that ended it."""
        return self.process.exitcode

    def send_signal(self, number: int) -> None:
        """Send a signal if it runs."""
        if self.status is None:
            with contextlib.suppress(ProcessLookupError):  # it may end at this moment
                os.kill(self.process.pid, number)


class Processes:
    """The children of one flight. Context manager: all have ended after the `with` block."""

    def __init__(self, logs: Path, environment: Mapping[str, str]):
        """logs: existing folder for the output; environment: all variables of the children."""
        self._logs = logs
        self._environment = dict(environment)
        self._children: dict[str, NodeProcess] = {}
        self.hurry: Callable[[], bool] = lambda: False  # True: send the next signal at once

    def start(
        self,
        name: str,
        module: str,
        arguments: Sequence[str] = (),
        may_end: bool = False,
        optional: bool = False,
        again: int = 0,
        nodes: tuple[str, ...] = (),
        place: Callable[[int], None] = lambda process: None,
    ) -> NodeProcess:
        """Run `module.main()` as the process `name`.

        may_end: it ends by itself when finished; optional: its end is no failure of the flight, see
        `missed`; again: number of restarts by `revive`; nodes: of the process, see `process_of`;
        place: called with the process id after each start.
        """
        log = self._logs / f"{name}.log"

        def run(further: Sequence[str]) -> BaseProcess:
            made = fork(name, module, [*arguments, *further], log, self._environment)
            place(made.pid)
            return made

        child = NodeProcess(name, run([]), log, run, may_end, optional, again, nodes)
        self._children[name] = child
        return child

    @property
    def names(self) -> list[str]:
        """Names of all started children, in order."""
        return list(self._children)

    def process_of(self, node: str) -> str:
        """Return the name of the process that has a node; the node's name if there is none."""
        having = (child.name for child in self._children.values() if node in child.nodes)
        return next(having, node)

    def pid(self, name: str) -> int:
        """Return the process id of a child."""
        return self._children[name].process.pid

    def let_end(self, name: str) -> None:
        """Treat the end of this child as no failure, unless it has restarts left for `revive`."""
        child = self._children[name]
        child.optional = not child.again

    def running(self, name: str) -> bool:
        """Return whether the child runs."""
        return self._children[name].status is None

    def stopped(self) -> list[NodeFailed]:
        """Return the running children that are stopped, by a signal or a debugger."""
        return [
            NodeFailed(child.name, None, child.log)
            for child in self._children.values()
            if child.status is None and not child.optional and _is_stopped(child.process.pid)
        ]

    def check(self) -> None:
        """Raise NodeFailed for a child that ended unexpectedly.

        Of several it reports a killed one: the others may have ended because of it.
        """
        failed = []
        for child in self._children.values():
            status = child.status
            if status is None or child.optional or (child.may_end and status == 0):
                continue
            failed.append(NodeFailed(child.name, status, child.log))
        if failed:
            raise min(failed, key=lambda one: one.status >= 0)

    def missed(self) -> list[NodeFailed]:
        """Return the optional children that ended by themselves, each only once."""
        ended = [c for c in self._children.values() if c.optional and not c.may_end]
        ended = [child for child in ended if child.status is not None]
        for child in ended:
            child.may_end = True
        return [NodeFailed(child.name, child.status, child.log) for child in ended]

    def revive(self, further: Callable[[str], Sequence[str]] = lambda _: ()) -> list[NodeFailed]:
        """Restart children that ended by themselves and have restarts left; return their failures.

        further: returns additional arguments for a child, by its name.
        """
        ended = [c for c in self._children.values() if c.again and not c.may_end]
        ended = [child for child in ended if child.status is not None]
        failures = [NodeFailed(child.name, child.status, child.log) for child in ended]
        for child in ended:
            child.again -= 1
            child.process = child.run(further(child.name))
        return failures

    def stop(self, names: Iterable[str]) -> list[str]:
        """Send SIGINT to these children, after a wait SIGTERM, then SIGKILL.

        Returns the names of those that did not end after SIGINT. Children that have already ended
        get no signal.
        """
        chosen = [self._children[name] for name in names if name in self._children]
        disobedient: set[str] = set()
        for signum, wait in (
            (signal.SIGINT, INTERRUPT_WAIT),
            (signal.SIGTERM, TERMINATE_WAIT),
            (signal.SIGKILL, None),
        ):
            left = [child for child in chosen if child.status is None]
            if not left:
                break
            if signum != signal.SIGINT:
                disobedient |= {child.name for child in left}
            for child in left:
                child.may_end = True
                child.send_signal(signum)
            deadline = None if wait is None else time.monotonic() + wait
            while any(child.status is None for child in left):
                if deadline is not None and (time.monotonic() > deadline or self.hurry()):
                    break
                time.sleep(POLL)
        return sorted(disobedient)

    def __enter__(self) -> "Processes":
        return self

    def __exit__(self, *exception) -> None:
        self.stop(self.names)
