"""The table of killed and surviving mutants, and what is wrong with it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from mutating.mutants import Mutant

HEADER = "| module | mutants | killed | survived | killed |\n|---|---|---|---|---|"


@dataclass(frozen=True)
class Judged:
    """A module's number of mutants, and those that survived; listed: see survivors.toml."""

    path: str
    mutants: int
    survivors: list[Mutant]
    listed: list[dict[str, str]]

    def row(self) -> str:
        """The module's row of the table."""
        return _row(f"`{self.path}`", self.mutants, len(self.survivors))

    def complaints(self) -> list[str]:
        """Survivors that are not listed, and listed ones that do not survive."""
        known = Counter((one["line"], one["becomes"]) for one in self.listed)
        lines = []
        for mutant in sorted(self.survivors, key=lambda one: one.number):
            if known[mutant.key]:
                known[mutant.key] -= 1
                continue
            lines.append(
                f"{self.path}:{mutant.number}: survives: {mutant.line!r} as {mutant.becomes!r} "
                f"({mutant.operator})"
            )
        return lines + [
            f"{self.path}: listed, but does not survive: {line!r} as {becomes!r}"
            for line, becomes in known.elements()
        ]


def total_row(judged: list[Judged]) -> str:
    """The last row: all modules together."""
    return _row("**all**", *_sums(judged))


def too_few(judged: list[Judged], least_percent: float) -> list[str]:
    """A complaint where fewer than `least_percent` of the mutants were killed."""
    total, left = _sums(judged)
    if total - left >= least_percent / 100.0 * total:
        return []
    return [f"{total - left} of {total} killed, {least_percent:g} % is the least"]


def _sums(judged: list[Judged]) -> tuple[int, int]:
    return sum(one.mutants for one in judged), sum(len(one.survivors) for one in judged)


def survivors_table(listed: dict[str, list[dict[str, str]]]) -> str:
    """The listed survivors, for the docs."""
    lines = ["| module | line | as | why it survives |", "|---|---|---|---|"]
    for path, entries in listed.items():
        for one in entries:
            cells = (f"`{one[name]}`".replace("|", "\\|") for name in ("line", "becomes"))
            lines.append(f"| {' | '.join((path, *cells, one['reason']))} |")
    return "\n".join(lines)


def _row(name: str, total: int, left: int) -> str:
    percent = 100.0 * (total - left) / total if total else 100.0
    return f"| {name} | {total} | {total - left} | {left} | {percent:.1f} % |"
