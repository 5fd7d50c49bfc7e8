"""Structured arrays (1,) for the numbers of a part."""

from __future__ import annotations

import numpy as np

from uam_control.maths.compiled import borrowing


def record(whole: str, real: str) -> np.ndarray:
    """Return a structured array (1,) of zeros; whole, real: names of its int64 and float64."""
    fields = [(name, np.int64) for name in whole.split()]
    fields += [(name, np.float64) for name in real.split()]
    return np.zeros(1, np.dtype((np.record, fields)))  # fields are attributes in plain Python, too


@borrowing
def put(values: np.ndarray, into: np.ndarray) -> None:
    """Copy values (n,) to into (n,)."""
    for i in range(len(into)):
        into[i] = values[i]
