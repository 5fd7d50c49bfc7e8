"""Messages of the rightful publisher that cannot be used, by topic.

Other joint names or their order, wrong lengths, numbers that are not finite, stamps of another
clock: the next good message is used.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Refused:
    """sender: node name; rightful: name of the node that may publish; reason: of the newest."""

    sender: str
    rightful: str
    reason: str = ""
    count: int = 0


class Refusals:
    """Counts the refused messages of each topic and sender."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str], Refused] = {}

    def note(self, topic: str, sender: str, rightful: str, reason: str) -> None:
        """Count a message; topic: absolute name; sender, rightful: node names."""
        one = self._found.setdefault((topic, sender), Refused(sender, rightful))
        one.rightful, one.reason, one.count = rightful, reason, one.count + 1

    @property
    def count(self) -> int:
        """Number of refused messages."""
        return sum(one.count for one in self._found.values())

    def texts(self) -> list[str]:
        """Return one line per topic and sender."""
        return [
            f"{topic}: refused {one.sender} ({one.count} messages): {one.reason}; "
            f"publisher is {one.rightful}"
            for (topic, _), one in self._found.items()
        ]
