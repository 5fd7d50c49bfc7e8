"""Starts, watches and stops the processes of one flight.

Each child has its own process group, so that Ctrl-C in the terminal reaches the orchestrator alone
and the children are stopped in order; its output goes to <logs>/<name>.log. It stays in the
session: schedulers share time between sessions first, whatever the processes' priorities.
See `child` for how they run.
"""

import signal
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from uam_lab.processes.child import Forked

LAST_LINES = 12  # of a failed node's log that its error message shows
INTERRUPT_WAIT, TERMINATE_WAIT = 10.0, 3.0  # seconds until the next, harder signal
POLL = 0.02  # seconds


class NodeFailed(RuntimeError):
    """A process of the flight ended by itself; the text says which, why, and its last lines."""

    def __init__(self, name: str, status: int, log: Path):
        self.name, self.status = name, status
        self.last_lines = tail(log)
        own_words = self.last_lines[-1] if self.last_lines else ""
        why = own_words.removeprefix(f"{name}: ")  # nodes end with one line that begins so
        said = f": {why}" if why != own_words else ""
        super().__init__(f"{name} {describe(status)}{said}")


def describe(status: int) -> str:
    """What a return code of subprocess means, in words."""
    if status < 0:
        try:
            return f"was killed by {signal.Signals(-status).name}"
        except ValueError:
            return f"was killed by signal {-status}"
    return f"ended by itself with exit status {status}"


def tail(log: Path, count: int = LAST_LINES) -> list[str]:
    """The last non-empty lines of a text file; none when it is not there."""
    try:
        with log.open("rb") as file:
            file.seek(max(0, log.stat().st_size - 16384))
            text = file.read().decode(errors="replace")
    except OSError:
        return []
    return [line for line in text.splitlines() if line.strip()][-count:]


@dataclass
class NodeProcess:
    """One running process."""

    name: str
    process: Forked
    log: Path
    run: Callable[[Sequence[str]], Forked]  # starts it again, with further arguments
    may_end: bool = False  # its end is expected: it was asked to stop, or ends with the mission
    optional: bool = False  # the flight goes on without it
    again: int = 0  # how often it is still started again where it ends by itself


class Processes:
    """The children of one flight. A context manager: nothing survives the `with` block."""

    def __init__(self, logs: Path, environment: Mapping[str, str]):
        """Output goes to `logs`, which must exist; `environment` is the children's whole one."""
        self._logs = logs
        self._environment = dict(environment)
        self._children: dict[str, NodeProcess] = {}
        self.hurry: Callable[[], bool] = lambda: False  # True: the next, harder signal at once

    def start(
        self,
        name: str,
        module: str,
        arguments: Sequence[str] = (),
        may_end: bool = False,
        optional: bool = False,
        again: int = 0,
    ) -> NodeProcess:
        """Run `module.main()` as the process `name`.

        may_end: it stops by itself when done; optional: its end is no failure of the flight, see
        `missed`; again: how often `revive` starts it again.
        """
        log = self._logs / f"{name}.log"

        def run(further: Sequence[str]) -> Forked:
            return Forked(name, module, [*arguments, *further], log, self._environment)

        child = NodeProcess(name, run([]), log, run, may_end, optional, again)
        self._children[name] = child
        return child

    @property
    def names(self) -> list[str]:
        """Everything that was started, in that order."""
        return list(self._children)

    def pid(self, name: str) -> int:
        """The process id of a child."""
        return self._children[name].process.pid

    def let_end(self, name: str) -> None:
        """Whatever ends this child, it is no failure of the flight; one to be revived will be."""
        child = self._children[name]
        child.optional = not child.again

    def running(self, name: str) -> bool:
        """True while the child has not ended."""
        return self._children[name].process.poll() is None

    def check(self) -> None:
        """Raise NodeFailed for a child that ended although nobody asked it to.

        Of several one that was killed: the others may have ended because of it.
        """
        failed = []
        for child in self._children.values():
            status = child.process.poll()
            if status is None or child.optional or (child.may_end and status == 0):
                continue
            failed.append(NodeFailed(child.name, status, child.log))
        if failed:
            raise min(failed, key=lambda one: one.status >= 0)

    def missed(self) -> list[NodeFailed]:
        """What became of optional children that ended by themselves, told once for each."""
        ended = [c for c in self._children.values() if c.optional and not c.may_end]
        ended = [child for child in ended if child.process.poll() is not None]
        for child in ended:
            child.may_end = True
        return [NodeFailed(child.name, child.process.returncode, child.log) for child in ended]

    def revive(self, further: Callable[[str], Sequence[str]] = lambda _: ()) -> list[NodeFailed]:
        """Start again what has ended by itself and may be; returns what became of each.

        further: arguments for the process of a name, after those that it was started with.
        """
        ended = [c for c in self._children.values() if c.again and not c.may_end]
        ended = [child for child in ended if child.process.poll() is not None]
        told = [NodeFailed(child.name, child.process.returncode, child.log) for child in ended]
        for child in ended:
            child.again -= 1
            child.process = child.run(further(child.name))
        return told

    def stop(self, names: Iterable[str]) -> list[str]:
        """Interrupt these children together, wait, then terminate, then kill.

        Returns the names of those that did not obey the interrupt. Children that have already
        ended, also by a failure, are left alone.
        """
        chosen = [self._children[name] for name in names if name in self._children]
        disobedient: set[str] = set()
        for signum, wait in (
            (signal.SIGINT, INTERRUPT_WAIT),
            (signal.SIGTERM, TERMINATE_WAIT),
            (signal.SIGKILL, None),
        ):
            left = [child for child in chosen if child.process.poll() is None]
            if not left:
                break
            if signum != signal.SIGINT:
                disobedient |= {child.name for child in left}
            for child in left:
                child.may_end = True
                child.process.send_signal(signum)
            deadline = None if wait is None else time.monotonic() + wait
            while any(child.process.poll() is None for child in left):
                if deadline is not None and (time.monotonic() > deadline or self.hurry()):
                    break
                time.sleep(POLL)
        return sorted(disobedient)

    def __enter__(self) -> "Processes":
        return self

    def __exit__(self, *exception) -> None:
        self.stop(self.names)
