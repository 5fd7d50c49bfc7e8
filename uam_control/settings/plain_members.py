"""Members of an enumeration as plain attributes of its class.

Python 3.11 finds `State.FLYING` by a descriptor written in Python, which takes 0.3 us, and a tick
compares some twenty of them. From Python 3.12 on members are plain attributes anyway.
"""

from enum import Enum
from typing import TypeVar

E = TypeVar("E", bound=type[Enum])


def plain_members(kind: E) -> E:
    """Return the enumeration `kind`, with its members as plain attributes; a class decorator."""
    for name, member in kind.__members__.items():
        type.__setattr__(kind, name, member)  # EnumType refuses to set a member again
    return kind
