"""Whole flights through the command line, as a user starts them."""

import fcntl
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import psutil

from uam_lab.flights.processes import process_table
from uam_sim_bridge.ports import SIMULATOR_TCP

ROOT = Path(__file__).resolve().parents[1]
PATIENCE = 240.0  # [s] only a failing test waits that long
# Up, a second of hovering, down: about 7 s of simulated time with arming.
SHORT = """\
description: Up and down, for tests.
arm_start: {alpha_1_deg: 0, alpha_2_deg: 90}
phases:
  - {from: 0, name: take-off}
  - {from: 1.5, name: hover}
  - {from: 2, name: land}
moves:
  - {coordinate: z, from: 0, until: 1.5, to: 0.6}
landing: {at: 2, duration: 2}
"""


class Flight:
    """`uam fly` in a process of its own."""

    def __init__(self, folder: Path, *options: str, report: bool = False):
        """Fly to <folder>/<out>; `options` go to the command line.

        report: make the report, without video; it takes longer than a short flight.
        """
        folder.mkdir(exist_ok=True)
        self.out = folder / "out"
        self._text = (folder / "stdout").open("w+")
        self._errors = (folder / "stderr").open("w+")
        command = [sys.executable, "-m", "uam_lab.cli.main", "fly", "--out", str(self.out)]
        self.process = subprocess.Popen(
            [*command, "--no-video" if report else "--no-report", *options],
            stdout=self._text,
            stderr=self._errors,
            cwd=ROOT,
            start_new_session=True,
        )

    @property
    def said(self) -> str:
        """Its standard output so far."""
        return (self.out.parent / "stdout").read_text()

    @property
    def complained(self) -> str:
        """Its standard error so far."""
        return (self.out.parent / "stderr").read_text()

    def until(self, condition: Callable[[], object], what: str) -> None:
        """Wait for `condition()` while it flies."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert self.process.poll() is None, f"{what}: it ended\n{self.said}{self.complained}"
            assert time.monotonic() < deadline, f"{what}: not in time\n{self.said}"
            time.sleep(0.05)

    def until_phase(self, phase: str) -> None:
        """Wait until the display has shown a phase."""
        self.until(lambda: f" s  {phase} " in self.said, phase)

    @property
    def instance(self) -> int:
        """The instance number of its ports."""
        return int(self.said.split("autopilot on TCP ")[1].split(",")[0]) - SIMULATOR_TCP

    def children(self) -> dict[str, int]:
        """Its nodes: name → process id."""
        below = psutil.Process(self.process.pid).children(recursive=True)
        found = {name: node.pid for node, name in process_table.nodes(below).items()}
        assert found, "no nodes"
        return found

    def wait(self, patience: float = PATIENCE) -> int:
        """Its exit status, within `patience` [s]."""
        return self.process.wait(patience)

    def end(self) -> None:
        """Kill it if it still runs."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        self._text.close()
        self._errors.close()


def is_gone(pid: int) -> bool:
    """Whether no process has this id any more (a zombie is gone, too)."""
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def lock_is_held(instance: int) -> bool:
    """Whether some process holds the lock of an instance; fail for a file that nobody holds.

    Another flight may be about to take it, or to remove it: not at once.
    """
    file = Path(tempfile.gettempdir()) / f"uam-{os.getuid()}-{instance}.lock"
    for _ in range(20):
        try:
            with file.open() as lock:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except FileNotFoundError:
            return False
        except BlockingIOError:
            return True
        time.sleep(0.1)
    raise AssertionError(f"{file} was left behind")


def wait_until_gone(pids: list[int], seconds: float = 20.0) -> None:
    """Wait until none of the processes exists; fail after `seconds`."""
    deadline = time.monotonic() + seconds
    while alive := [pid for pid in pids if not is_gone(pid)]:
        assert time.monotonic() < deadline, f"still there: {alive}"
        time.sleep(0.1)


def assert_nothing_left(flight: Flight, pids: list[int]) -> None:
    """No process or temporary file is there; the lock may be another flight's."""
    assert [pid for pid in pids if not is_gone(pid)] == []
    assert list(flight.out.rglob(".*")) == []
    lock_is_held(flight.instance)
