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

    def late(self, noise: np.random.Generator) -> float:
        """Return the delay [s] of the next message."""
        return 0.0

    def loses(self, noise: np.random.Generator) -> bool:
        """Return whether the next message does not arrive whole."""
        return False

    def arriving(self, packet: bytes, noise: np.random.Generator) -> bytes | None:
        """Return the next packet as it arrives; None: it does not."""
        return None if self.loses(noise) else packet


class MavlinkCut(LinkFault):
    """No message arrives."""

    def loses(self, noise: np.random.Generator) -> bool:
        return True


class MavlinkDelay(LinkFault):
    """Every message arrives later."""

    delay: float = number(0.05, "added delay", "s", 0.0, 10.0)
    jitter: float = number(0.0, "largest further delay of a message, uniform", "s", 0.0, 10.0)

    def late(self, noise: np.random.Generator) -> float:
        return self.delay + (noise.uniform(0.0, self.jitter) if self.jitter else 0.0)


class MavlinkCorruption(LinkFault):
    """Some packets have one wrong byte, and the receiver discards them."""

    share: float = number(0.2, "fraction of wrong packets", "1", 0.0, 1.0)

    def loses(self, noise: np.random.Generator) -> bool:
        return noise.random() < self.share

    def arriving(self, packet: bytes, noise: np.random.Generator) -> bytes:
        if not self.loses(noise):
            return packet
        corrupted = bytearray(packet)
        corrupted[noise.integers(len(corrupted))] ^= int(noise.integers(1, 256))
        return bytes(corrupted)
