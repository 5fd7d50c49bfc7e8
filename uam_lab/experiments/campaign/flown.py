"""The flights of a campaign as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from uam_control.coordinates import POSITION
from uam_lab.experiments.trials.outcome import OUTCOMES, counts
from uam_lab.experiments.trials.trial import TrialResult


class Flown:
    """names: of the errors' coordinates; rms (flights, 6 + n) [m, deg]; drawn: name → value of each
    flight; error: RMS of the distance to the reference [m]."""

    def __init__(self, results: Mapping[int, TrialResult]) -> None:
        """results: by the flight's number, at least one."""
        flights = list(results.values())
        self.names = flights[0].coordinates
        self.rms = np.array([one.rms for one in flights])
        self.error = np.linalg.norm(self.rms[:, POSITION], axis=1)
        self.drawn = {
            name: np.array([one.drawn[name] for one in flights]) for name in flights[0].drawn
        }
        self.numbers = np.array(list(results))
        self.outcome = [one.outcome for one in flights]
        self.why = [one.why for one in flights]
        self.failed = np.array([not one.completed for one in flights])

    def __len__(self) -> int:
        """Return the number of flights."""
        return len(self.numbers)

    @cached_property
    def outcomes(self) -> dict[str, int]:
        """Number of flights by outcome."""
        return counts(self.outcome)

    def worst(self, count: int) -> list[int]:
        """Return the rows of the worst flights: by outcome, then by error."""
        severity = {outcome: k for k, outcome in enumerate(OUTCOMES)}
        classes = np.array([severity[one] for one in self.outcome])
        error = np.where(np.isfinite(self.error), self.error, np.inf)
        return [int(row) for row in np.lexsort((self.numbers, -error, -classes))[:count]]
