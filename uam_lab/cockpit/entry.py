"""Parameter values as people type them, and how far a slider reaches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from uam_lab.cockpit.remote_parameters import About

REACH = 4.0  # a slider goes to this many times the value at which it was made
STEPS = 400


def text_of(value: Any) -> str:
    """A value as it is typed."""
    if isinstance(value, list):
        return ", ".join(text_of(one) for one in value)
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def value_of(text: str, like: Any) -> Any:
    """What `text` says, in the kind of `like`, the present value. Raises ValueError."""
    if isinstance(like, list):
        return [_number(part) for part in text.replace(";", ",").split(",")]
    if isinstance(like, bool):
        word = text.strip().lower()
        if word not in ("true", "false"):
            raise ValueError(f"{text.strip() or 'nothing'}: true or false expected")
        return word == "true"
    if isinstance(like, int | float):
        return _number(text)
    return text.strip()


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{text.strip() or 'nothing'}: a number expected") from None


def reach(about: About, value: float) -> tuple[float, float, float]:
    """(least, largest, step) of a slider that begins at `value`."""
    low, high = bounds(about)
    low = max(low, min(0.0, REACH * value))
    high = min(high, max(REACH * value, 1.0 if value == 0.0 else value / REACH))
    high = max(high, value)
    low = min(low, value)
    return low, high, (high - low) / STEPS or 1.0


def bounds(about: About) -> tuple[float, float]:
    """The range that the node declares, also of each entry of a vector."""
    if about.low is not None and about.high is not None:
        return about.low, about.high
    words = about.constraints.removeprefix("each ").split()
    try:
        return float(words[0]), float(words[2])
    except (IndexError, ValueError):
        return -np.inf, np.inf


def axes(about: About, count: int) -> Sequence[str]:
    """Names of the entries of a vector, as the node tells them, or their numbers."""
    _, _, told = about.constraints.partition("; ")
    names = [name.strip() for name in told.split(",") if name.strip()]
    return names if len(names) == count else [str(number) for number in range(count)]
