"""JSON in the texts of a message: parameter values, parameters of faults.

Anyone may send one. What is read is bounded in length and depth, and has numbers that Python and
ROS have, too: no program ends while it works with the value.
"""

from __future__ import annotations

import json
from typing import Any

from uam_msgs_py.messages.layouts import BadMessage

LONGEST = 100_000  # characters
DEEPEST = 8  # lists and mappings in each other
LARGEST = 1 << 63  # of whole numbers


def read_json(text: str, deepest: int = DEEPEST) -> Any:
    """Return the value of a JSON text; raises BadMessage for a text or value out of bounds.

    deepest: number of levels, 1 for a single value.
    """
    if len(text) > LONGEST:
        raise BadMessage(f"JSON of {len(text)} characters, at most {LONGEST} allowed")
    try:
        value = json.loads(text)
    except RecursionError:
        raise BadMessage(f"JSON with more than {deepest} levels") from None
    except ValueError as error:
        raise BadMessage(f"no JSON: {error}") from None
    level = [value]
    for _ in range(deepest):
        for one in level:
            _check(one)
        level = [part for one in level for part in _parts(one)]
        if not level:
            return value
    raise BadMessage(f"JSON with more than {deepest} levels")


def _parts(value: Any) -> list[Any]:
    """Return the values and names in a list or mapping."""
    if isinstance(value, dict):
        return [*value, *value.values()]
    return value if isinstance(value, list) else []


def _check(value: Any) -> None:
    if isinstance(value, int) and not -LARGEST <= value < LARGEST:
        raise BadMessage("a whole number of more than 64 bits")
    if isinstance(value, str):
        try:
            value.encode()
        except UnicodeEncodeError:  # half of a pair: it can be neither printed nor sent
            raise BadMessage("a text with half of a Unicode pair") from None
