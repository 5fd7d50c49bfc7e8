"""JSON in a message or a parameter: parameter values, faults, changes of the vehicle.

Anyone may send one. What is read is bounded in length and depth, and has numbers that Python and
ROS have, too: no program ends while it works with the value.
"""

import json
from typing import Any

LONGEST = 100_000  # characters
DEEPEST = 8  # lists and mappings in each other
LARGEST = 1 << 63  # of whole numbers


class JsonError(ValueError):
    """A text or value out of bounds; the message is one line."""


def read_json(text: str, deepest: int = DEEPEST) -> Any:
    """Return the value of a JSON text; raises JsonError for a text or value out of bounds.

    deepest: number of levels, 1 for a single value.
    """
    if len(text) > LONGEST:
        raise JsonError(f"JSON of {len(text)} characters, at most {LONGEST} allowed")
    try:
        value = json.loads(text)
    except RecursionError:
        raise JsonError(f"JSON with more than {deepest} levels") from None
    except ValueError as error:
        raise JsonError(f"no JSON: {error}") from None
    level = [value]
    for _ in range(deepest):
        for one in level:
            _check(one)
        level = [part for one in level for part in _parts(one)]
        if not level:
            return value
    raise JsonError(f"JSON with more than {deepest} levels")


def read_mapping(text: str, error: type[ValueError], expected: str) -> dict[str, Any]:
    """Return the mapping of a JSON text; raises `error`: `expected`, and why the text is none."""
    try:
        value = read_json(text)
    except JsonError as reason:
        raise error(f"{expected}; {reason}") from None
    if not isinstance(value, dict):
        raise error(expected)
    return value


def _parts(value: Any) -> list[Any]:
    """Return the values and names in a list or mapping."""
    if isinstance(value, dict):
        return [*value, *value.values()]
    return value if isinstance(value, list) else []


def _check(value: Any) -> None:
    if isinstance(value, int) and not -LARGEST <= value < LARGEST:
        raise JsonError("a whole number of more than 64 bits")
    if isinstance(value, str):
        try:
            value.encode()
        except UnicodeEncodeError:  # half of a pair: it can be neither printed nor sent
            raise JsonError("a text with half of a Unicode pair") from None
