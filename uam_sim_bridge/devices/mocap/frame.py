"""What a motion capture source delivers: frames with the rigid bodies of one exposure."""

from collections.abc import Iterable
from typing import NamedTuple, Protocol

import numpy as np


class MocapError(ValueError):
    """A motion capture system, its calibration or a measurement that cannot be used; one line."""


class BodyPose(NamedTuple):
    """Pose of a rigid body in the tracker's axes: position (3,) [m], unit quaternion (4,).

    The quaternion [w x y z] goes from the rigid body's axes to the tracker's.
    """

    position: np.ndarray
    quaternion: np.ndarray


class Frame(NamedTuple):
    """One exposure.

    arrival [ns]: host's clock; number: counted by the server, None if it counts none; exposed,
    sent [s]: middle of the exposure and transmission by the server's clock, None if not known;
    bodies: name → pose, None for a body that is not tracked in this frame.
    """

    arrival: int
    number: int | None
    exposed: float | None
    sent: float | None
    bodies: dict[str, BodyPose | None]


class MocapSource(Protocol):
    """A connection to a tracking system.

    `connected`: whether the server has answered; `names`: of the rigid bodies that it knows, None
    before its list arrives; `bad`: packets that cannot be read; `sessions`: number of connections
    so far; `description`: what it is connected to, and `failure`: what is wrong with it, "" for
    nothing, both for messages.
    """

    connected: bool
    names: tuple[str, ...] | None
    bad: int
    sessions: int
    description: str
    failure: str

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
