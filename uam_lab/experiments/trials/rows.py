"""Results of trials as rows of a table, and the table on disk, each key once.

The columns follow from the result's fields. Rows arrive one by one, in any order. New ones are
written every few seconds to a small file of their own in the folder beside the table,
`<table>.parts`; `compact` merges these into the table. Every file is written atomically. A process
that is killed loses the rows of the last seconds and nothing else.
"""

import json
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Self, get_args, get_origin, get_type_hints

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from uam_control.settings.atomic import replacing
from uam_lab.records.results.metrics import plain

COLUMNS = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
NUMBER = pa.field("flight", pa.int64())  # key of most tables: number of the trial
EVERY = 5.0  # [s] between two parts
PARTS = 200  # number of parts at which they are merged, so that a long campaign has few files
MARK = b"uam_rows_of"


@dataclass(frozen=True)
class Rows:
    """Rows of results that are a dataclass, with a key. Each of the `parts` of a field has a column
    <field>.<name>. A field of another type than text, number or bool is JSON in its column."""

    kind: type  # the dataclass
    parts: Mapping[str, Sequence[str]] = field(default_factory=dict)  # field → names of its numbers
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


class RowTableError(ValueError):
    """The file contains other rows, or cannot be read; the text is one line."""


class RowTable:
    """The rows in `file`. The first field of the schema is the key, a whole number or a text.
    A context manager whose end writes the last rows."""

    def __init__(self, file: Path, schema: pa.Schema, of: Mapping[str, str]) -> None:
        """of: name → digest of all inputs of the rows.

        Raises RowTableError if the file has rows of other inputs, with the names that differ.
        """
        self.file, self._parts = file, file.with_suffix(".parts")
        self._schema = schema.with_metadata({MARK: json.dumps(dict(of)).encode()})
        self.key = schema.names[0]  # its name
        self._waiting: list[Mapping[str, Any]] = []
        self._written, self._number = time.monotonic(), 0
        if file.exists() or self._part_files():
            self.compact()
        self.keys = set(self._read([self.key])[self.key].to_pylist())  # of the rows so far

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception) -> None:
        self.flush()

    def add(self, row: Mapping[str, Any]) -> None:
        """Add a row with the fields of the schema; a key that is there already is left out."""
        if row[self.key] in self.keys:
            return
        self.keys.add(row[self.key])
        self._waiting.append(row)
        if time.monotonic() - self._written >= EVERY:
            self.flush()

    def flush(self) -> None:
        """Write the rows that wait for the next part."""
        self._written = time.monotonic()
        if not self._waiting:
            return
        self._parts.mkdir(exist_ok=True)
        self._number += 1
        part = self._parts / f"{time.time_ns()}-{os.getpid()}-{self._number}.parquet"
        self._write(pa.Table.from_pylist(self._waiting, self._schema), part)
        self._waiting.clear()
        if self._number % PARTS == 0:
            self.compact()

    def compact(self) -> pa.Table:
        """Merge the parts into the table; return it, sorted by key.

        The same rows give the same bytes, whatever the order and the number of their arrivals.
        """
        self.flush()
        parts = self._part_files()
        table = self._read()
        keys = table[self.key].to_numpy(zero_copy_only=False)
        table = table.take(np.unique(keys, return_index=True)[1])
        if parts or not self.file.exists():
            self._write(table, self.file)
        for part in parts:
            part.unlink()
        if self._parts.exists() and not any(self._parts.iterdir()):
            self._parts.rmdir()
        return table

    def _part_files(self) -> list[Path]:
        return sorted(self._parts.glob("[!.]*.parquet")) if self._parts.exists() else []

    def _read(self, columns: list[str] | None = None) -> pa.Table:
        """Return all rows on disk, the table's first, keys perhaps more than once."""
        files = [self.file] if self.file.exists() else []
        tables = [self._open(file) for file in (*files, *self._part_files())]
        tables.append(self._schema.empty_table())
        return pa.concat_tables([one.select(columns) if columns else one for one in tables])

    def _open(self, file: Path) -> pa.Table:
        try:
            table = pq.read_table(file)
        except (OSError, pa.ArrowException) as error:
            raise RowTableError(f"{file} cannot be read: {str(error).splitlines()[0]}") from None
        if not table.schema.equals(self._schema, check_metadata=True):
            raise RowTableError(
                f"{self.file.parent} contains flights with other settings: "
                f"{self._changed(table.schema)}; undo the change, or give another --out"
            )
        return table

    def _changed(self, found: pa.Schema) -> str:
        """Return what differs from the inputs of the rows in a file with the schema `found`."""
        try:
            before = json.loads((found.metadata or {}).get(MARK, b"{}"))
        except ValueError:  # of an earlier version
            before = {}
        now = json.loads(self._schema.metadata[MARK])
        differs = [
            f"{name} was {before[name]}, is {now[name]}"
            for name in now
            if name in before and before[name] != now[name]
        ]
        differs += [name for name in sorted(before.keys() ^ now.keys()) if before]
        return ", ".join(differs) or "columns or version of the table"

    @staticmethod
    def _write(table: pa.Table, file: Path) -> None:
        with replacing(file) as temporary:
            pq.write_table(table.combine_chunks(), temporary, compression="zstd")
