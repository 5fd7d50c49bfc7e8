"""Commands and parameters for the nodes of one flight, from any thread."""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from uam_lab.flights.library.flight_result import CommandRefused, FlightError
from uam_lab.flights.operator import NoFlight, Operator
from uam_lab.flights.processes.guest import Guest
from uam_lab.flights.processes.node_environment import transport_environment
from uam_lab.flights.ros.profile_switch import ProfileSwitch, SwitchRefused

if TYPE_CHECKING:
    from geometry_msgs.msg import PoseStamped


Changes = dict[str, dict[str, tuple[Any, Any]]]  # node → name → (old, new)
Found = TypeVar("Found")


class Commands:
    """Clients in the ROS domain of a flight, made at their first use. Raises CommandRefused."""

    def __init__(self, domain: int, namespace: str, arguments: Sequence[str]) -> None:
        """domain, namespace: of the flight; arguments: of ROS, as remappings."""
        self._place, self._arguments = (domain, namespace), tuple(arguments)
        self._lock = threading.Lock()
        self._clients: dict[type, tuple[Guest, Any]] = {}

    def guest(self, name: str) -> Guest:
        """Return a new node in the flight's graph; the caller closes it."""
        return Guest(name, transport_environment(), *self._place, self._arguments)

    def call(self, act: Callable[[Operator], Found]) -> Found:
        """Return act(operator); one call at a time."""
        return self._act(Operator, "uam_operator", act)

    def ask(self, name: str, *given: Any) -> str:
        """Return the answer to a method of the operator with these arguments, if it accepts."""
        accepted, text = self.call(lambda operator: getattr(operator, name)(*given))
        if not accepted:
            raise CommandRefused(text)
        return text

    def change(self, act: Callable[[ProfileSwitch], Changes]) -> Changes:
        """Return act(switch): what it has changed in all nodes, or in none; one call at a time."""
        return self._act(ProfileSwitch, "uam_parameters", act)

    def _act(self, kind: type, name: str, act: Callable[[Any], Found]) -> Found:
        with self._lock, _refusals():
            if kind not in self._clients:
                guest = self.guest(name)
                self._clients[kind] = guest, kind(guest.node)
            return act(self._clients[kind][1])

    def close(self) -> None:
        with self._lock:
            for guest, _ in self._clients.values():
                guest.close()
            self._clients.clear()


@contextlib.contextmanager
def _refusals() -> Iterator[None]:
    try:
        yield
    except SwitchRefused as error:
        raise CommandRefused("; ".join(str(error).splitlines())) from None
    except NoFlight as error:
        raise FlightError(str(error)) from None


class Hand:
    """Commands as those of `Flight`; each raises CommandRefused with the reason."""

    def __init__(self, commands: Callable[[], Commands]) -> None:
        self._commands = commands

    def goto(self, x: float, y: float, z: float, yaw: float | None = None) -> str:
        """Bring the hand to a position [m, ENU] and hold it there; yaw [rad]: heading, None: as it
        is. Returns the answer."""
        return self._commands().ask("goto", x, y, z, math.nan if yaw is None else yaw, True)

    def plan(self, message: Any) -> str:
        """Fly a PoseStamped, a MultiDOFJointTrajectory or a TwistStamped of the hand."""
        return self._commands().ask("plan", message, True)

    @property
    def pose(self) -> PoseStamped:
        """The estimate of the hand's pose in the world."""
        return self._commands().call(Operator.hand_pose)
