"""Results of trials as rows of a table, and back: the columns follow from the result's fields."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
import pyarrow as pa

from uam_lab.records.results.metrics import plain

COLUMNS = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
NUMBER = pa.field("flight", pa.int64())  # key of most tables: number of the trial


@dataclass(frozen=True)
class Rows:
    """Rows of results that are a dataclass, with a key.

    kind: the dataclass. parts: field with several numbers → their names; each has a column
    <field>.<name>. A field of another type than text, number or bool is JSON in its column.
    """

    kind: type
    parts: Mapping[str, Sequence[str]] = field(default_factory=dict)
    key: pa.Field = NUMBER

    @property
    def schema(self) -> pa.Schema:
        """Return the columns, the key first."""
        found = [self.key]
        for name, kind in self._fields().items():
            columns = {one: pa.float64() for one in self._split(name)}
            found += (columns or {name: COLUMNS.get(kind, pa.string())}).items()
        return pa.schema(found)

    def to_row(self, key: Any, result: Any) -> dict[str, Any]:
        """Return the row of a result."""
        row = {self.key.name: key}
        for name, kind in self._fields().items():
            value = getattr(result, name)
            if name in self.parts:
                values = value.values() if isinstance(value, Mapping) else value
                row |= zip(self._split(name), map(float, values), strict=True)
            else:
                row[name] = value if kind in COLUMNS else json.dumps(value, default=plain)
        return row

    def from_row(self, row: Mapping[str, Any]) -> Any:
        """Return the result of a row."""
        found = {}
        for name, kind in self._fields().items():
            if name in self.parts:
                value = [row[one] for one in self._split(name)]
                value = dict(zip(self.parts[name], value, strict=True)) if kind is dict else value
            else:
                value = row[name] if kind in COLUMNS else json.loads(row[name])
            make = {np.ndarray: np.array, tuple: tuple}.get(kind)
            found[name] = value if make is None else make(value)
        return self.kind(**found)

    def _split(self, name: str) -> list[str]:
        return [f"{name}.{part}" for part in self.parts.get(name, ())]

    def _fields(self) -> dict[str, type]:
        """Return field → its type: that of `float | None` is float, of `tuple[...]` tuple."""
        hints = get_type_hints(self.kind)
        found = {}
        for one in fields(self.kind):
            hint, parts = hints[one.name], get_args(hints[one.name])
            found[one.name] = parts[0] if type(None) in parts else get_origin(hint) or hint
        return found
