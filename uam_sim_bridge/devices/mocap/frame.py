"""What a motion capture source delivers: frames with the rigid bodies of one exposure."""

from collections.abc import Iterable
from typing import NamedTuple, Protocol

import numpy as np


class MocapError(ValueError):
    """A motion capture system, its calibration or a measurement that cannot be used; one line."""


class BodyPose(NamedTuple):
    """Pose of a rigid body in the tracker's axes."""

    position: np.ndarray  # (3,) [m]
    quaternion: np.ndarray  # (4,) [w x y z] rigid body's axes → tracker's, unit norm


class Frame(NamedTuple):
    """One exposure."""

    arrival: int  # [ns] host's clock
    number: int | None  # counted by the server; None: it counts none
    exposed: float | None  # [s] middle of the exposure, server's clock; None: not known
    sent: float | None  # [s] transmission, server's clock; None: not known
    bodies: dict[str, BodyPose | None]  # by name; None: not tracked in this frame


class MocapSource(Protocol):
    """A connection to a tracking system."""

    connected: bool  # whether the server has answered
    names: tuple[str, ...] | None  # of the rigid bodies that it knows; None: its list has not come
    bad: int  # packets that cannot be read
    sessions: int  # number of connections so far
    description: str  # what it is connected to, for messages
    failure: str  # what is wrong with it, for messages; "": nothing

    def frames(self, timeout: float) -> list[Frame]:
        """Return the frames that have arrived; wait at most `timeout` [s] for the first."""
        ...

    def close(self) -> None:
        """End the connection."""
        ...


def unknown_body(source: MocapSource, bodies: Iterable[str]) -> str:
    """Return one line about a body that the server does not know, "" before its list arrives."""
    names = source.names
    for name in () if names is None else bodies:
        if name not in names:
            there = ", ".join(sorted(names)) or "none"
            return f"no rigid body '{name}' in {source.description}; there are: {there}"
    return ""
