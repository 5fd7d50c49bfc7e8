"""The result of a trial as a row of a table, and back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import pyarrow as pa

from uam_control.coordinates import coordinates
from uam_lab.experiments.campaign.trial import TrialResult

NUMBER = "flight"  # key of the tables: number of the draw, or of the trial
DRAWN, RMS, LARGEST = "drawn.", "rms.", "largest."  # prefixes of columns
RESTLESS = ("restless.rates", "restless.torques")  # [rad/s], [N m]


def schema(joints: int, drawn: Sequence[str] = ()) -> pa.Schema:
    """Return the columns for a vehicle with so many joints. drawn: names of drawn values.

    Errors are in m and deg, the payload in kg, `flown` is flown time / planned time.
    """
    names, number = coordinates(joints), pa.float64()
    return pa.schema(
        [
            (NUMBER, pa.int64()),
            *((DRAWN + name, number) for name in drawn),
            *(("label", pa.string()), ("payload_mass", number), ("seed", pa.int64())),
            *((RMS + name, number) for name in names),
            *((LARGEST + name, number) for name in names),
            *(("flown", number), ("cut_short", pa.bool_())),
            *(("outcome", pa.string()), ("why", pa.string()), ("place_error", number)),
            *((name, number) for name in RESTLESS),
            ("peaks", pa.string()),  # JSON: column of the adaptation → largest value
        ]
    )


def to_row(
    number: int, result: TrialResult, drawn: Mapping[str, float] = MappingProxyType({})
) -> dict[str, Any]:
    """Return the row of flight `number`; drawn: its drawn values."""
    names = result.coordinates
    return {
        NUMBER: number,
        **{DRAWN + name: value for name, value in drawn.items()},
        **{name: getattr(result, name) for name in _PLAIN},
        **{RMS + name: float(value) for name, value in zip(names, result.rms, strict=True)},
        **{LARGEST + name: float(x) for name, x in zip(names, result.largest, strict=True)},
        **dict(zip(RESTLESS, result.restless, strict=True)),
        "peaks": json.dumps(result.peaks),
    }


def from_row(row: Mapping[str, Any]) -> TrialResult:
    """Return the result of a row."""

    def block(prefix: str) -> np.ndarray:
        return np.array([value for name, value in row.items() if name.startswith(prefix)])

    return TrialResult(
        **{name: row[name] for name in _PLAIN},
        rms=block(RMS),
        largest=block(LARGEST),
        restless=tuple(row[name] for name in RESTLESS),
        peaks=json.loads(row["peaks"]),
    )


_PLAIN = (
    *("label", "payload_mass", "seed", "flown", "cut_short"),
    *("outcome", "why", "place_error"),
)
