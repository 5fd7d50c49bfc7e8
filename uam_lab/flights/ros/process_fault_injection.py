"""Process faults: kill, stop or slow down processes of a flight at mission times.

The mission time comes from the mission's status, twice a second, so a fault starts up to half a
simulated second late. Its duration is wall time, because in lockstep the flight waits for a
stopped process. A fault of a node affects its process, with all nodes in it.
"""

import contextlib
import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Self

import psutil

from uam_lab.flights.flight_settings import AUTOPILOT
from uam_lab.flights.processes.processes import Processes
from uam_lab.flights.processes.thread_stop import StoppedThreads
from uam_sim_bridge.faults import Schedule
from uam_sim_bridge.faults.process_faults import DiscoveryLoss, NodeKill, NodeSlow, ProcessFault
from uam_sim_bridge.faults.schedule import TimedFault
from uam_sim_bridge.faults.timeline import FaultState, PhaseTimes
from uam_sim_bridge.ports import is_discovery_port

# threads of Fast DDS: one sends the announcements, one per UDP port receives
EVENTS, PORT = "dds.ev.", "dds.udp."


def of_discovery(thread: str) -> bool:
    """Return whether a thread of this name does only DDS discovery."""
    port = thread.removeprefix(PORT)
    return thread.startswith(EVENTS) or (
        thread.startswith(PORT) and port.isdecimal() and is_discovery_port(int(port))
    )


def program_of(name: str, pid: int) -> int:
    """Return the process that does the work of the node `name` with process id `pid`.

    For the autopilot it is PX4, if the node runs it as its child.
    """
    if name == AUTOPILOT:
        with contextlib.suppress(psutil.Error):
            for child in psutil.Process(pid).children():
                return child.pid
    return pid


class ProcessFaults:
    """Context manager; call `update` often. At its end all stopped processes continue."""

    def __init__(
        self,
        children: Processes,
        schedule: Schedule,
        announce: Callable[[FaultState], None],
        clock: Callable[[], float] = time.monotonic,
        lockstep: bool = False,
    ):
        """schedule: process faults; announce: called when a fault begins or ends; clock: [s].

        lockstep: the end of a process ends the flight.
        """
        self._children, self._announce, self._clock = children, announce, clock
        self._lockstep = lockstep
        self._all = [FaultState(one, number) for number, one in enumerate(schedule.faults)]
        self._phases = PhaseTimes()
        self._ends: dict[int, float] = {}  # by the clock
        self._hindering: dict[int, _Hindrance | StoppedThreads] = {}

    def add(self, planned: TimedFault, mission_time: float) -> None:
        """Begin a fault at the next update; its own begin does not count."""
        due = replace(planned, at=mission_time, phase="")
        self._all.append(FaultState(due, len(self._all)))

    def update(self, mission_time: float | None, phase: str) -> None:
        """Begin the due faults and end the expired ones; mission_time [s], None: unknown."""
        now = self._clock()
        if mission_time is not None:
            self._phases.at(phase, mission_time)
        for hindrance in self._hindering.values():
            hindrance.look()
        for one in self._all:
            due = mission_time is not None and mission_time >= self._phases.begin(one.planned)
            if one.begin is None and due:
                one.begin = mission_time
                self._ends[one.number] = now + one.planned.duration
                self._begin(one)
                self._announce(one)
            elif one.active and now >= self._ends[one.number] and mission_time is not None:
                one.end = mission_time
                self._release(one.number)
                self._announce(one)

    def _begin(self, one: FaultState) -> None:
        fault = one.fault
        assert isinstance(fault, ProcessFault)
        process = self._children.process_of(fault.node)
        if not self._children.running(process):
            return
        pid = program_of(process, self._children.pid(process))
        if isinstance(fault, NodeKill):
            if not self._lockstep:  # there the plant would wait for it without end
                self._children.let_end(process)
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
            return
        if isinstance(fault, DiscoveryLoss):
            self._hindering[one.number] = StoppedThreads(pid, of_discovery)
            return
        stopped, cycle = (fault.stopped, fault.cycle) if isinstance(fault, NodeSlow) else (1.0, 0.0)
        self._hindering[one.number] = _Hindrance(
            pid, partial(self._children.running, process), stopped, cycle
        )

    def _release(self, number: int) -> None:
        hindrance = self._hindering.pop(number, None)
        if hindrance is not None:
            hindrance.end()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception) -> None:
        for number in list(self._hindering):
            self._release(number)


class _Hindrance:
    """Stops a process: completely, or for a part of each cycle, by a thread."""

    def __init__(self, pid: int, running: Callable[[], bool], stopped: float, cycle: float):
        self._pid, self._running = pid, running
        self._over = threading.Event()
        self._thread: threading.Thread | None = None
        if stopped >= 1.0:
            self._signal(signal.SIGSTOP)
        else:
            phases = ((signal.SIGSTOP, stopped * cycle), (signal.SIGCONT, (1.0 - stopped) * cycle))
            self._thread = threading.Thread(target=self._cycle, args=(phases,), daemon=True)
            self._thread.start()

    def look(self) -> None:
        """Do nothing; the counterpart of `StoppedThreads.look`."""

    def end(self) -> None:
        """Let the process continue."""
        self._over.set()
        if self._thread is not None:
            self._thread.join()
        self._signal(signal.SIGCONT)

    def _cycle(self, phases: tuple[tuple[signal.Signals, float], ...]) -> None:
        while not self._over.is_set() and self._running():
            for number, wait in phases:
                self._signal(number)
                self._over.wait(wait)

    def _signal(self, number: signal.Signals) -> None:
        """Send a signal if the child runs; its pid is then valid, as it was not waited for.

        A program that the child runs may end a moment earlier.
        """
        if self._running():
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._pid, number)
