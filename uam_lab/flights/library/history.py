"""What a flight has reported so far, and waiting for what it will report."""

import asyncio
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from itertools import islice

from uam_control.mission.mission_output import PHASES
from uam_control.supervision import State
from uam_lab.flights.library.flight_result import NotInTime
from uam_lab.flights.node_options import SettingsError
from uam_lab.flights.observer import FlightStatus, Observer

Condition = Callable[[FlightStatus], bool]
Kind = str | Condition
POLL = 0.05  # [s] between two looks of a waiting coroutine
KEPT = 4000  # statuses, of half an hour of flight: a flight may last for many hours


class History(Observer):
    """Stores the newest statuses and every message, and passes them on to another observer."""

    def __init__(self, further: Observer) -> None:
        self._further = further
        self.bring_up, self.finish = further.bring_up, further.finish
        self._news = threading.Condition()
        self.statuses: deque[FlightStatus] = deque(maxlen=KEPT)
        self._count = 0  # of all statuses so far
        self.messages: list[str] = []
        self.running = False  # from the start of the processes to their end
        self.over = False  # the result is complete
        self.domain: int | None = None
        self._seen = 0  # number of statuses before the last one that was waited for, with it

    def message(self, text: str) -> None:
        """Store one line about the flight."""
        self.messages.append(text)
        self._further.message(text)

    def started(self, domain: int | None) -> None:
        with self._news:
            self.running, self.domain = True, domain
            self._news.notify_all()
        self._further.started(domain)

    def update(self, status: FlightStatus) -> None:
        with self._news:
            self.statuses.append(status)
            self._count += 1
            self._news.notify_all()
        self._further.update(status)

    def end(self) -> None:
        with self._news:
            self.running, self.over = False, True
            self._news.notify_all()

    def forget(self) -> None:
        """Ignore the statuses so far in the next `found`, except the newest."""
        with self._news:
            self._seen = self._count

    def found(self, condition: Condition) -> FlightStatus | None:
        """Return the first status of this kind since the last one found; None without one.

        The newest status counts again.
        """
        with self._news:
            forgotten = self._count - len(self.statuses)
            first = max(min(self._seen, self._count - 1), forgotten)
            for number, status in enumerate(islice(self.statuses, first - forgotten, None), first):
                if condition(status):
                    self._seen = number + 1
                    return status
        return None

    def wait(self, done: Callable[[], bool], timeout: float | None, what: str) -> None:
        """Wait until done(), which is called after each report.

        timeout: [s] of wall time, None: no limit. Raises NotInTime.
        """
        end = None if timeout is None else time.monotonic() + timeout
        with self._news:
            while not done():
                left = None if end is None else end - time.monotonic()
                if left is not None and left <= 0.0:
                    raise NotInTime(f"{what}: not within {timeout:g} s; {self.summary}")
                self._news.wait(left)

    async def wait_async(self, done: Callable[[], bool], timeout: float | None, what: str) -> None:
        """Wait as `wait`, without blocking the event loop."""
        loop = asyncio.get_running_loop()
        end = None if timeout is None else loop.time() + timeout
        while not done():
            if end is not None and loop.time() > end:
                raise NotInTime(f"{what}: not within {timeout:g} s; {self.summary}")
            await asyncio.sleep(POLL)

    @property
    def summary(self) -> str:
        """The newest status, or message before the first, as one line."""
        if not self.statuses:
            return self.messages[-1] if self.messages else "the flight has not started"
        status = self.statuses[-1]
        return f"the flight is in phase {status.phase}, {status.state or status.autopilot}"


class Awaited:
    """A status of a kind that is waited for; `status`: None if the flight ends before."""

    def __init__(self, history: History, condition: Condition, name: str) -> None:
        self._history, self._condition, self.name = history, condition, name
        self.status: FlightStatus | None = None

    def done(self) -> bool:
        """Return whether there is such a status, or the flight is over."""
        self.status = self._history.found(self._condition)
        return self.status is not None or self._history.over


def awaited(history: History, what: Kind, of_scenario: Iterable[str]) -> Awaited:
    """Return what is waited for; of_scenario: names of its phases. Raises SettingsError."""
    if callable(what):
        return Awaited(history, what, "the condition")
    phases = dict.fromkeys([*of_scenario, *PHASES])
    states = [state.value for state in State]
    if what not in phases and what not in states:
        raise SettingsError(
            f"unknown phase or state '{what}'; there are the phases {', '.join(phases)} and "
            f"the states {', '.join(states)}"
        )
    return Awaited(history, lambda status: what in (status.phase, status.state), f"'{what}'")
