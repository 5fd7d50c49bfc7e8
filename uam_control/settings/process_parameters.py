"""How a node's process uses the processor: priority, cores, memory, busy polling, garbage.

And whether the times of its ticks are measured.
"""

from dataclasses import dataclass
from typing import Any

from uam_control.settings.parameter_set import (
    ParameterError,
    ParameterSet,
    integer,
    number,
    switch,
    text,
)

CORES = "numbers and ranges with commas between, as 1,3 or 2-3; empty: every core"
HIGHEST_CORE = 1023  # of Linux's processor sets


@dataclass(frozen=True)
class ProcessParameters(ParameterSet):
    """Parameters of a node's process; they cannot change while it runs."""

    fifo_priority: int = integer(
        0, "real-time priority under SCHED_FIFO, ahead of every ordinary process; 0: none", 0, 98
    )
    nice: int = integer(
        0, "nice value among ordinary processes; below 0: preferred to the others", -20, 19
    )
    cores: str = text("", "processor cores that the process may use", CORES)
    lock_memory: bool = switch(False, "keep the process's memory from being swapped out: mlockall")
    busy_poll: float = number(
        0.0,
        "time after a tick in which the node looks for its next input without sleeping; it uses a "
        "core so long; 0: it sleeps at once",
        "s",
        0.0,
        0.1,
    )
    collect_between_ticks: bool = switch(
        True, "collect Python's cyclic garbage between two ticks; false: whenever Python does"
    )

    def changes(self) -> dict[str, Any]:
        """Return the parameters that differ from their defaults."""
        default = ProcessParameters().to_mapping()
        return {name: value for name, value in self.to_mapping().items() if value != default[name]}

    def check_together(self) -> None:
        """Raise ParameterError for cores that are no list, or two priorities at once."""
        cores_of(self.cores)
        if self.fifo_priority and self.nice:
            raise ParameterError(
                f"nice: {self.nice} has no effect under SCHED_FIFO (fifo_priority "
                f"{self.fifo_priority}); give one of them"
            )


@dataclass(frozen=True)
class TickTimesParameters(ParameterSet):
    """Measurement of the ticks; it cannot change while the node runs."""

    tick_times: str = text(
        "", "file to which the times of the node's ticks are written at its end", "empty: none"
    )
    tick_times_kept: int = integer(
        200_000, "newest ticks whose times are kept, 128 bytes each", 1, 10_000_000
    )


def cores_of(given: str) -> frozenset[int]:
    """Return the cores in a text like 0,2-3; none if it is empty. Raises ParameterError."""
    found: set[int] = set()
    for part in filter(None, (part.strip() for part in given.split(","))):
        first, dash, last = part.partition("-")
        last = last if dash else first
        if not (first.isdecimal() and last.isdecimal()) or int(first) > int(last):
            raise ParameterError(f"cores: '{part}'; allowed: {CORES}")
        if int(last) > HIGHEST_CORE:
            raise ParameterError(f"cores: {last} is above {HIGHEST_CORE}")
        found.update(range(int(first), int(last) + 1))
    return frozenset(found)


@dataclass(frozen=True)
class DeviceWait(ParameterSet):
    """What a driver does without its device; it cannot change while the node runs."""

    wait_for_device: bool = switch(
        False, "a device that is absent at the start: true: wait for it; false: refuse to start"
    )
