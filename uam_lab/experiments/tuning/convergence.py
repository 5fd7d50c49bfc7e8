"""When a search has converged: its last evaluations improved the result by less than a share."""

from __future__ import annotations

import math
from collections.abc import Sequence

SMALL = 0.01  # share of the result
LEAST = 20  # evaluations without improvement from which on a search may be called converged


def improvement(curve: Sequence[float], patience: int) -> float:
    """Return by which share the last `patience` evaluations improved the result.

    curve: best cost, or area under the front, after each evaluation. infinity while there are not
    more evaluations than that, for a patience below 1, or if the result before was zero.
    """
    if patience < 1 or len(curve) <= patience or curve[-1 - patience] == 0.0:
        return math.inf
    before = curve[-1 - patience]
    return abs(curve[-1] - before) / abs(before)


def in_words(curve: Sequence[float], patience: int) -> str:
    """Return one line: whether the search has converged, and why."""
    share = improvement(curve, patience)
    if math.isinf(share):
        return f"not converged: {len(curve)} evaluations, of which the last {patience} would count"
    state = "converged" if share < SMALL else "not converged"
    return f"{state}: the last {patience} of {len(curve)} evaluations improved it by {share:.2%}"
