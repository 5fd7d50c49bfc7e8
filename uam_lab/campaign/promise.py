"""Promise of a row of a fault matrix: allowed outcomes, and time until touchdown."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from uam_lab.campaign.fault_outcome import OUTCOMES
from uam_sim_bridge.faults import FaultError

KEYS = {"outcome", "within"}


@dataclass(frozen=True)
class Promise:
    """outcomes: the allowed ones of OUTCOMES; within [s]: longest time from the fault to the final
    touchdown, if the mission is not completed."""

    outcomes: tuple[str, ...]
    within: float = math.inf

    def kept(self, outcome: str, down_after: float | None) -> bool:
        """Return whether a flight kept the promise; down_after [s]: None without touchdown."""
        soon = down_after is None or down_after <= self.within
        return outcome in self.outcomes and soon


def read(given: Any, where: str) -> Promise:
    """Read an entry `promise` of a matrix: {outcome: one or a list, within: seconds}.

    Raises FaultError.
    """
    if not isinstance(given, Mapping) or not {"outcome"} <= set(given) <= KEYS:
        raise FaultError(f"{where}: promise: {{outcome: ..., within: seconds}} expected")
    named = given["outcome"]
    outcomes = tuple(named) if isinstance(named, list) else (named,)
    for one in outcomes:
        if not isinstance(one, str) or one not in OUTCOMES:
            raise FaultError(
                f"{where}: promise: unknown outcome '{one}'; there are: {', '.join(OUTCOMES)}"
            )
    within = given.get("within", math.inf)
    if isinstance(within, bool) or not isinstance(within, int | float) or not within > 0.0:
        raise FaultError(f"{where}: promise: within: {within!r} is not a time above 0 s")
    return Promise(outcomes, float(within))
