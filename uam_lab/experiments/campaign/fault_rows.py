"""The result of a flight of a fault matrix as a row of a table, and back."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import pyarrow as pa

from uam_lab.experiments.campaign.fault_trial import FaultResult
from uam_lab.experiments.campaign.trial_rows import NUMBER
from uam_lab.records.results.metrics import plain

NESTED = ("worst", "happened")  # JSON in the table
TYPES = {
    **dict.fromkeys(("fault", "moment", "outcome", "why", "given"), pa.string()),
    **dict.fromkeys(("duration_s", "down_after_s", "tilt_deg", "impact"), pa.float64()),
    "kept": pa.bool_(),
}
SCHEMA = pa.schema(
    [(NUMBER, pa.int64()), *TYPES.items(), *((name, pa.string()) for name in NESTED)]
)


def to_row(number: int, result: FaultResult) -> dict[str, Any]:
    """Return the row of flight `number` of the matrix."""
    return {
        NUMBER: number,
        **{name: getattr(result, name) for name in TYPES},
        **{name: json.dumps(plain(getattr(result, name))) for name in NESTED},
    }


def from_row(row: Mapping[str, Any]) -> FaultResult:
    """Return the result of a row."""
    nested = {name: json.loads(row[name]) for name in NESTED}
    values = {name: row[name] for name in TYPES} | nested
    return FaultResult(**values | {"happened": tuple(nested["happened"])})
