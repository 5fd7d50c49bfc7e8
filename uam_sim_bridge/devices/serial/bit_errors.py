"""Bit errors of a line."""

from __future__ import annotations

import numpy as np


def disturbed(data: bytes, rate: float, noise: np.random.Generator) -> bytes:
    """Return `data` with each bit inverted with probability `rate`."""
    if not rate or not data:
        return data
    flips = noise.random(8 * len(data)) < rate
    return (np.frombuffer(data, np.uint8) ^ np.packbits(flips)).tobytes()
