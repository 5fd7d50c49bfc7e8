"""Parameter values as text, and the ranges of sliders."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from uam_lab.cockpit.remote_parameters import About

REACH = 4.0  # end of a slider / initial value
STEPS = 400


def text_of(value: Any) -> str:
    """Return a value as text."""
    if isinstance(value, list):
        return ", ".join(text_of(one) for one in value)
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def value_of(text: str, like: Any) -> Any:
    """Return the value of `text`, of the type of `like`, the current value. Raises ValueError."""
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
    """Return (low, high, step) of a slider with the initial value `value`."""
    low, high = bounds(about)
    low = max(low, min(0.0, REACH * value))
    high = min(high, max(REACH * value, 1.0 if value == 0.0 else value / REACH))
    high = max(high, value)
    low = min(low, value)
    return low, high, (high - low) / STEPS or 1.0


def bounds(about: About) -> tuple[float, float]:
    """Return the range declared by the node; for a vector that of each entry."""
    if about.low is not None and about.high is not None:
        return about.low, about.high
    words = about.constraints.removeprefix("each ").split()
    try:
        return float(words[0]), float(words[2])
    except (IndexError, ValueError):
        return -np.inf, np.inf


def axes(about: About, count: int) -> Sequence[str]:
    """Return the names of a vector's entries from its constraints, or their numbers."""
    _, _, listed = about.constraints.partition("; ")
    names = [name.strip() for name in listed.split(",") if name.strip()]
    return names if len(names) == count else [str(number) for number in range(count)]
