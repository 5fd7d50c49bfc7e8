"""Start nodes by fork of a process that has imported them and loaded the compiled functions.

`Forks` is the test's end; this file run as a program is the process that forks. One line of JSON
each way: a request to start a node, the id of its process, the exit status at its end.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path


class Forked:
    """A started node, with the methods of subprocess.Popen that the tests call."""

    def __init__(self, forks: Forks, pid: int):
        self._forks, self.pid = forks, pid

    def poll(self) -> int | None:
        """Return the exit status; None while it runs."""
        self._forks.receive(0.0)
        return self._forks.statuses.get(self.pid)

    def wait(self, timeout: float = 60.0) -> int:
        """Return the exit status; raise TimeoutExpired after `timeout` [s]."""
        end = time.monotonic() + timeout
        while self.poll() is None:
            if time.monotonic() > end:
                raise subprocess.TimeoutExpired(f"process {self.pid}", timeout)
            self._forks.receive(0.1)
        return self.poll()

    def send_signal(self, number: int) -> None:
        """Send a signal if it still runs."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill it if it still runs."""
        self.send_signal(signal.SIGKILL)


class Forks:
    """The process that forks; `statuses`: process id → exit status of the nodes that have ended."""

    def __init__(self):
        ours, theirs = socket.socketpair()
        command = [sys.executable, __file__, str(theirs.fileno())]
        self._process = subprocess.Popen(command, pass_fds=[theirs.fileno()])
        theirs.close()
        self._socket, self._unread = ours, b""
        self.statuses: dict[int, int] = {}
        self._started: int | None = None

    def start(self, module: str, arguments: list[str], log: Path) -> Forked:
        """Run main() of `module` with the environment and the folder of this process."""
        log.touch()  # the test may read it before the node has opened it
        request = [module, arguments, str(log), dict(os.environ), os.getcwd()]
        self._socket.sendall(json.dumps(request).encode() + b"\n")
        while self._started is None:
            self.receive(60.0)
        pid, self._started = self._started, None
        return Forked(self, pid)

    def receive(self, timeout: float) -> None:
        """Read the answers that have come within `timeout` [s], two ends at once among them."""
        if not select.select([self._socket], [], [], timeout)[0]:
            return
        received = self._socket.recv(65536)
        assert received, "the process that forks has ended"
        *lines, self._unread = (self._unread + received).split(b"\n")
        for answer in map(json.loads, lines):
            if len(answer) == 1:
                (self._started,) = answer
            else:
                self.statuses[answer[0]] = answer[1]

    def close(self) -> None:
        """End the process that forks."""
        self._socket.close()
        self._process.wait()


def serve(connection: socket.socket) -> list | None:
    """Import and fork for each request: return it in the child; None in the parent at the end."""
    importlib.import_module("uam_lab.flights.ros.forker")  # from which a flight forks its nodes
    lines = connection.makefile("rw")
    wake, woken = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
    signal.set_wakeup_fd(woken)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    while True:
        readable = select.select([connection, wake], [], [])[0]
        if wake in readable:
            os.read(wake, 4096)
            answer_ended(lines)
        if connection in readable:
            request = lines.readline()
            if not request:
                return None
            with contextlib.suppress(Exception):  # the child then fails with it
                importlib.import_module(json.loads(request)[0])
            pid = os.fork()
            if pid == 0:
                signal.set_wakeup_fd(-1)
                signal.signal(signal.SIGCHLD, signal.SIG_DFL)
                for end in (wake, woken):
                    os.close(end)
                lines.detach()
                connection.close()
                return json.loads(request)
            lines.write(json.dumps([pid]) + "\n")
            lines.flush()


def answer_ended(lines) -> None:
    """Send the exit statuses of the processes that have ended, as subprocess gives them."""
    with contextlib.suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            lines.write(json.dumps([ended[0], os.waitstatus_to_exitcode(ended[1])]) + "\n")
            lines.flush()


def become(module: str, arguments: list[str], log: str, environment: dict, folder: str) -> int:
    """Run main() of `module` in this process as if it had been started as a program."""
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    for number, file, how in ((0, os.devnull, os.O_RDONLY), (1, log, os.O_WRONLY | os.O_CREAT)):
        opened = os.open(file, how)
        os.dup2(opened, number)
        os.close(opened)
    os.dup2(1, 2)
    sys.argv = ["-c", *arguments]
    return importlib.import_module(module).main()


if __name__ == "__main__":
    requested = serve(socket.socket(fileno=int(sys.argv[1])))
    if requested is not None:
        ended = become(*requested)
        sys.stdout.flush()
        os._exit(ended or 0)  # taking the interpreter down would copy all memory of this process
