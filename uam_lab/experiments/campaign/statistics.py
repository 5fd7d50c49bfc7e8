"""Shares and percentiles of many flights, with confidence bands of 95 %."""

import math
from dataclasses import dataclass

import numpy as np

Z = 1.959964  # standard deviations of a normal distribution that contain 95 %
BINS, PER_BIN = 10, 20  # of a slice: largest number of bins, least number of flights in one


def share(count: int, total: int) -> tuple[float, float, float]:
    """Return count / total and its confidence band: Wilson's score interval.

    E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209. It stays within 0 to 1 and is not empty where
    the count is 0 or the total.
    """
    p = count / total
    middle = (p + Z**2 / (2 * total)) / (1 + Z**2 / total)
    half = Z / (1 + Z**2 / total) * math.sqrt(p * (1 - p) / total + Z**2 / (4 * total**2))
    return p, min(p, middle - half), max(p, middle + half)


def percentile(values: np.ndarray, percent: float) -> tuple[float, float, float]:
    """Return a percentile and its confidence band; NaN entries do not count.

    The band is between two of the sorted values: the number of values below the percentile is
    binomially distributed, whatever the distribution of the values is. An end that would need more
    values is infinite. NaN without a value.
    """
    known = np.sort(values[np.isfinite(values)])
    if not known.size:
        return math.nan, math.nan, math.nan
    q, n = percent / 100.0, known.size
    half = Z * math.sqrt(n * q * (1.0 - q))
    first, last = math.floor(n * q - half), math.ceil(n * q + half)
    middle = float(np.percentile(known, percent))
    low = float(known[first]) if first >= 0 else -math.inf
    high = float(known[last]) if last < n else math.inf
    return middle, min(low, middle), max(high, middle)


@dataclass(frozen=True)
class Bin:
    """The flights whose value is between low and high. completed: `share`; error: percentiles 5, 50
    and 95."""

    low: float
    high: float
    flights: int
    completed: tuple[float, float, float]
    error: tuple[float, float, float]


def sliced(values: np.ndarray, failed: np.ndarray, error: np.ndarray) -> list[Bin]:
    """Divide the flights by a value, into bins of (nearly) equal numbers of flights.

    values: one per flight; failed: mask; error: one per flight, may be NaN.
    """
    count = max(1, min(BINS, len(values) // PER_BIN))
    found = []
    for rows in np.array_split(np.argsort(values, kind="stable"), count):
        known = error[rows][np.isfinite(error[rows])]
        band = np.percentile(known, (5.0, 50.0, 95.0)) if known.size else np.full(3, np.nan)
        done = int(np.count_nonzero(~failed[rows]))
        found.append(
            Bin(
                float(values[rows].min()),
                float(values[rows].max()),
                len(rows),
                share(done, len(rows)),
                tuple(float(one) for one in band),
            )
        )
    return found
