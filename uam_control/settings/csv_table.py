"""Reader of CSV files with a header: every field where it belongs, and one-line errors."""

import csv
import math
from collections.abc import Collection, Iterator
from pathlib import Path

from uam_control.settings.texts import text_of

OTHER_SEPARATORS = {";": "';'", "\t": "a tab", "|": "'|'"}


class CsvTable:
    """A file: its header, and rows of as many fields; blank lines are skipped.

    header: names; header_line: its line in the file, from 1; lines: those of the rows.
    """

    def __init__(self, file: Path, error: type[ValueError]) -> None:
        """Read a file and check its header; raise `error` with file and line."""
        self.file, self._error = file, error
        self.header: list[str] = []
        self.header_line = 1
        self.lines: list[int] = []
        self._rows: list[list[str]] = []
        for line, fields in self._fields(text_of(file, error)):
            if self.header:
                self.lines.append(line)
                self._rows.append(fields)
            else:
                self.header, self.header_line = fields, line
                self._check_header()
        if not self.header:
            raise error(f"{file}: empty; a header expected, then one row per sample")

    def error(self, line: int, text: str, column: str = "") -> ValueError:
        """Return the error of a line, or of a field in it."""
        place = f"line {line} column {column}" if column else f"line {line}"
        return self._error(f"{self.file} {place}: {text}")

    def numbers(self, columns: Collection[str]) -> list[list[float]]:
        """Return the finite numbers of the columns, by rows; raise the error of a bad row."""
        places = [(self.header.index(name), name) for name in columns]
        found = []
        for line, row in zip(self.lines, self._rows, strict=True):
            if len(row) != len(self.header):
                raise self.error(
                    line,
                    f"{len(row)} fields, the header in line {self.header_line} has "
                    f"{len(self.header)}; each row needs as many",
                )
            found.append([self._number(line, row[place], name) for place, name in places])
        return found

    def _number(self, line: int, field: str, column: str) -> float:
        try:
            value = float(field)
        except ValueError:
            value = math.nan
        # Python reads 1_0 and digits of all scripts, other programs do not
        if not (math.isfinite(value) and field.isascii()) or "_" in field:
            raise self.error(line, f"{field!r} is not a finite number", column)
        return value

    def _fields(self, text: str) -> Iterator[tuple[int, list[str]]]:
        """Yield line and fields, without the spaces around them."""
        reader = csv.reader(text.split("\n"), strict=True)
        try:
            for fields in reader:
                stripped = [field.strip() for field in fields]
                if stripped not in ([], [""]):
                    yield reader.line_num, stripped
        except csv.Error as reason:
            raise self.error(reader.line_num, f"not valid CSV: {reason}") from None

    def _check_header(self) -> None:
        for separator, named in OTHER_SEPARATORS.items():
            if len(self.header) == 1 and separator in self.header[0]:
                raise self.error(
                    self.header_line,
                    f"{named} separates the columns; commas expected, and points in the numbers",
                )
        for name in self.header:
            if self.header.count(name) > 1:
                raise self.error(self.header_line, f"column {name} is there twice")
