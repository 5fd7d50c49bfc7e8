"""Check of the instances (ports and ROS domains of a flight): which are free or in use."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from uam_lab.flights.processes import process_table
from uam_lab.preflight.doctor.finding import Finding, fail, ok, warn
from uam_sim_bridge.ports import INSTANCES, busy_port, held, lock_file, ports_of

SHOWN = 4  # busy ports named in the line


@dataclass(frozen=True)
class Busy:
    """An instance in use. who: its user, as text; flight: whether that is another flight."""

    instance: int
    who: str
    flight: bool


def checks(folder: Path | None = None) -> Iterator[Finding]:
    """Yield the finding; folder: of the lock files of flights."""
    busy = [found for number in range(INSTANCES) if (found := look(number, folder))]
    free = INSTANCES - len(busy)
    first = next(n for n in range(INSTANCES + 1) if n not in {b.instance for b in busy})
    text = f"{free} of {INSTANCES} instances are free" + (f", the first is {first}" if free else "")
    flights = sum(b.flight for b in busy)
    others = [b for b in busy if not b.flight]
    if flights:
        text += f"; flights have {flights}"
    if others:
        named = [f"{b.instance}: {b.who}" for b in others[:SHOWN]]
        text += "; " + ", ".join(named)
        if len(others) > SHOWN:
            text += f" and {len(others) - SHOWN} more"
    if not free:
        yield fail("instances", text, "end flights or the programs named here")
    elif others:
        yield warn(
            "instances", text, "flights use a free one; end these programs if they are leftovers"
        )
    else:
        yield ok("instances", text)


def look(instance: int, folder: Path | None = None) -> Busy | None:
    """Return the user of an instance, None if it is free; reserve nothing."""
    lock = lock_file(folder, instance)
    if held(lock):
        return Busy(instance, ", ".join(process_table.users_of_file(lock)) or "a flight", True)
    port = busy_port(ports_of(instance))
    if port is None:
        return None
    users = process_table.users_of_port(port.protocol.lower(), port.number)
    who = ", ".join(users) or "an unknown program"
    return Busy(instance, f"{port}, held by {who}", False)
