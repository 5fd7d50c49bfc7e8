"""The table of killed and surviving mutants, and what is wrong with it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from mutating.mutants import Mutant


@dataclass(frozen=True)
class Result:
    """Mutants and survivors by path; listed: survivors with a reason, see survivors.toml."""

    found: dict[str, list[Mutant]]
    survivors: dict[str, list[Mutant]]
    listed: dict[str, list[dict[str, str]]]
    least_percent: float

    def markdown(self) -> str:
        """A row per module, and the sum."""
        rows = [(path, len(all_of), len(self._left(path))) for path, all_of in self.found.items()]
        lines = ["| module | mutants | killed | survived | killed |", "|---|---|---|---|---|"]
        lines += [_row(f"`{path}`", total, left) for path, total, left in rows]
        total, left = (sum(row[i] for row in rows) for i in (1, 2))
        lines.append(_row("**all**", total, left))
        return "\n".join(lines)

    def complaints(self) -> list[str]:
        """Survivors that are not listed, listed ones that do not survive, too few killed."""
        lines = []
        for path in self.found:
            known = Counter((one["line"], one["becomes"]) for one in self.listed.get(path, []))
            for mutant in self._left(path):
                if known[mutant.key]:
                    known[mutant.key] -= 1
                    continue
                lines.append(
                    f"{path}:{mutant.number}: survives: {mutant.line!r} as {mutant.becomes!r} "
                    f"({mutant.operator})"
                )
            lines += [
                f"{path}: listed, but does not survive: {line!r} as {becomes!r}"
                for line, becomes in known.elements()
            ]
        total = sum(map(len, self.found.values()))
        killed = total - sum(len(self._left(path)) for path in self.found)
        if killed < self.least_percent / 100.0 * total:
            lines.append(f"{killed} of {total} killed, {self.least_percent:g} % is the least")
        return lines

    def _left(self, path: str) -> list[Mutant]:
        return sorted(self.survivors.get(path, []), key=lambda mutant: mutant.number)


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
