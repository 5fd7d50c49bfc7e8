"""Faults of the MAVLink connection between bridge and autopilot: cut, delay, corruption."""

from typing import ClassVar

import numpy as np

from uam_control.settings.parameter_set import choice, number
from uam_sim_bridge.faults.fault import LINK, Fault

BOTH, TO, FROM = "both", "to_autopilot", "from_autopilot"


class LinkFault(Fault):
    """A fault of the bridge's transport."""

    PLACE: ClassVar[str] = LINK

    direction: str = choice(BOTH, "affected direction", (BOTH, TO, FROM))

    @property
    def outwards(self) -> bool:
        """Return whether it acts on messages to the autopilot."""
        return self.direction != FROM

    @property
    def inwards(self) -> bool:
        """Return whether it acts on messages from the autopilot."""
        return self.direction != TO


class MavlinkCut(LinkFault):
    """No message arrives."""


class MavlinkDelay(LinkFault):
    """Every message arrives later."""

    delay: float = number(0.05, "added delay", "s", 0.0, 10.0)
    jitter: float = number(0.0, "largest further delay of a message, uniform", "s", 0.0, 10.0)

    def late(self, noise: np.random.Generator) -> float:
        """Return the delay [s] of the next message."""
        return self.delay + (noise.uniform(0.0, self.jitter) if self.jitter else 0.0)


class MavlinkCorruption(LinkFault):
    """Some packets have one wrong byte, and the receiver discards them."""

    share: float = number(0.2, "fraction of wrong packets", "1", 0.0, 1.0)
