"""The flights of a campaign as arrays, from their table."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import pyarrow as pa

from uam_control.coordinates import POSITION
from uam_lab.experiments.campaign.fault_outcome import COMPLETED, OUTCOMES, counts
from uam_lab.experiments.campaign.trial_rows import DRAWN, NUMBER, RMS


class CampaignTable:
    """names: of the errors' coordinates; rms (flights, 6 + n) [m, deg]; drawn: name → value of each
    flight; error: RMS of the distance to the reference [m]."""

    def __init__(self, table: pa.Table) -> None:
        """table: with the columns of `trial_rows.schema`, at least one row."""
        self.names = [name.removeprefix(RMS) for name in table.column_names if name.startswith(RMS)]
        self.rms = np.column_stack([table[RMS + name].to_numpy() for name in self.names])
        self.error = np.linalg.norm(self.rms[:, POSITION], axis=1)
        self.drawn = {
            name.removeprefix(DRAWN): table[name].to_numpy()
            for name in table.column_names
            if name.startswith(DRAWN)
        }
        self.numbers = table[NUMBER].to_numpy()
        self.outcome: Sequence[str] = table["outcome"].to_pylist()
        self.why: Sequence[str] = table["why"].to_pylist()

    def __len__(self) -> int:
        """Return the number of flights."""
        return len(self.numbers)

    @cached_property
    def failed(self) -> np.ndarray:
        """Mask (flights,) of the missions that were not completed."""
        return np.array([one != COMPLETED for one in self.outcome])

    @property
    def outcomes(self) -> dict[str, int]:
        """Number of flights by outcome."""
        return counts(self.outcome)

    def worst(self, count: int) -> list[int]:
        """Return the rows of the worst flights: by outcome, then by error."""
        severity = {outcome: k for k, outcome in enumerate(OUTCOMES)}
        classes = np.array([severity[one] for one in self.outcome])
        error = np.where(np.isfinite(self.error), self.error, np.inf)
        return [int(row) for row in np.lexsort((self.numbers, -error, -classes))[:count]]
