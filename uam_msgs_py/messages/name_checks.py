"""Checks of a message's joint names and numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from uam_msgs_py.messages.layouts import BadMessage


def check_names(given: Sequence[str], expected: Sequence[str]) -> None:
    """Raise BadMessage unless `given` are exactly the expected joint names, in order."""
    if list(given) != list(expected):
        raise BadMessage(
            f"joint names {', '.join(given) or '(none)'}; expected {', '.join(expected)}"
        )


def check_length(what: str, length: int, names: Sequence[str]) -> None:
    """Raise BadMessage unless `length` equals the number of `names`; what: text for the error."""
    if length != len(names):
        raise BadMessage(f"{length} {what}, {len(names)} expected ({', '.join(names)})")


def refuse_infinite(what: str, values: np.ndarray, names: Sequence[str]) -> None:
    """Raise BadMessage unless all values (n,) of the joints `names` (n) are finite."""
    if not math.isfinite(values.sum()):
        for name, value in zip(names, values, strict=True):
            if not math.isfinite(value):
                raise BadMessage(f"{what} of {name} is {value}")
        raise BadMessage(f"{what} overflow")
