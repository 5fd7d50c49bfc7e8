"""Fly the numbers of the documentation again and list those that moved.

    .venv/bin/python benchmarks/numbers_of_docs.py                    # `make numbers`: half an hour
    .venv/bin/python benchmarks/numbers_of_docs.py --only short       # what CI runs
    .venv/bin/python benchmarks/numbers_of_docs.py --only slow        # the rest, hours
    .venv/bin/python benchmarks/numbers_of_docs.py docs/tuning.md    # of some pages
    .venv/bin/python benchmarks/numbers_of_docs.py --update           # write what moved

A mark names the command that made the tables after it, up to the next mark or heading:

    <!-- numbers: uam margins; 2 %; short -->
    <!-- numbers: benchmarks/load.py; once 2026-11-20, two cores, nothing else running -->

After the command: the tolerance (default 1 %, and one unit of the last digit that is written), and
when it runs: short, slow, or never: once (hardware, hours, times of one machine), given (chosen,
not measured; in place of a command the source). Lines of a table are compared with the lines of the
command's output that have the same words; those that begin with "the paper" are not.
"""

from __future__ import annotations

import argparse
import re
import shlex
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MARK = re.compile(r"<!-- numbers: (?P<command>[^;]*?)(?P<options>;.*)? -->")
NUMBER = re.compile(r"(?<![\w.])[-−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
PAPER = re.compile(r"\|\s*the paper")  # a row that is not measured here
RULE = re.compile(r"[|\s:-]+")  # line below a table's head
WHEN = ("", "short", "slow", "once", "given")
TOLERANCE = 0.01
LONGEST = 3600.0  # [s] of a command


@dataclass(frozen=True)
class Mark:
    """A mark. line: its index; end: that of the first line after its tables; tolerance: relative;
    when: one of WHEN."""

    file: Path
    line: int
    end: int
    command: str
    tolerance: float
    when: str


def marks(file: Path) -> Iterator[Mark]:
    """Yield the marks of a page."""
    lines = file.read_text().splitlines()
    for index, line in enumerate(lines):
        if found := MARK.match(line):
            stop = (
                i
                for i, text in enumerate(lines[index + 1 :], index + 1)
                if text.startswith(("#", "<!-- numbers:"))
            )
            words = [word.strip() for word in (found["options"] or "").split(";")]
            share = next((float(w[:-1]) / 100 for w in words if w.endswith("%")), TOLERANCE)
            when = next((w for word in words for w in WHEN[1:] if word.startswith(w)), "")
            yield Mark(file, index, next(stop, len(lines)), found["command"], share, when)


def is_row(line: str) -> bool:
    """Return whether a line is of a table and may have numbers."""
    return line.startswith("|") and not RULE.fullmatch(line)


def unmarked(file: Path) -> list[int]:
    """Return the lines (from 1) at which tables with measured numbers begin without a mark.

    Measured: most of the cells below the head are numbers.
    """
    lines = file.read_text().splitlines()
    covered = {i for mark in marks(file) for i in range(mark.line, mark.end)}
    found = []
    for index, line in enumerate(lines):
        if RULE.fullmatch(line) and "|" in line and index - 1 not in covered:
            cells = []
            for row in lines[index + 1 :]:
                if not row.startswith("|"):
                    break
                cells += [cell.strip() for cell in row.strip("|").split("|")[1:]]
            if sum(bool(NUMBER.match(cell)) for cell in cells) > len(cells) / 2:
                found.append(index)
    return found


def words(line: str) -> str:
    """Return a line without its numbers: what the same line has at another time."""
    return re.sub(r"\s+", " ", NUMBER.sub("#", line)).strip()


def moved(old: str, new: str, tolerance: float) -> list[tuple[str, str]]:
    """Return the numbers of a line that differ: (old, new)."""
    pairs = zip(NUMBER.findall(old), NUMBER.findall(new), strict=True)
    return [(a, b) for a, b in pairs if not _near(a, b, tolerance)]


def _near(a: str, b: str, tolerance: float) -> bool:
    one, other = (float(text.replace("−", "-")) for text in (a, b))
    digits = len(a.partition("e")[0].partition(".")[2])
    unit = 10.0**-digits if "e" not in a else 0.0
    # a whole number counts something: it is the same or it is not
    rounding = 1.001 * unit if digits else 0.0
    return abs(one - other) <= max(tolerance * abs(one), rounding)


@dataclass(frozen=True)
class Difference:
    """A number of a line (from 1) of a page that is another in the command's output."""

    file: Path
    line: int
    old: str
    new: str


def compare(mark: Mark, output: str) -> list[Difference]:
    """Return where the tables of a mark differ from a command's output."""
    made = defaultdict(list)
    for text in output.splitlines():
        made[words(text)].append(text.strip())
    lines, found = mark.file.read_text().splitlines(), []
    for index in range(mark.line + 1, mark.end):
        old = lines[index]
        if not is_row(old) or not NUMBER.search(old) or PAPER.match(old):
            continue
        same = made[words(old)]
        if not same:
            found.append(Difference(mark.file, index + 1, "the line", "not in the output"))
            continue
        # the nearest of those with the same words, each once
        new = min(same, key=lambda text: len(moved(old, text, mark.tolerance)))
        same.remove(new)
        for a, b in moved(old, new, mark.tolerance):
            found.append(Difference(mark.file, index + 1, a, b))
    return found


def run(command: str) -> tuple[str, str]:
    """Run a command of a mark; return its output, and why it failed."""
    words = shlex.split(command)
    bin = ROOT / ".venv" / "bin"
    start = [str(bin / "uam")] if words[0] == "uam" else [str(bin / "python"), words[0]]
    try:
        done = subprocess.run(
            [*start, *words[1:]], cwd=ROOT, capture_output=True, text=True, timeout=LONGEST
        )
    except subprocess.TimeoutExpired:
        return "", f"not done within {LONGEST:g} s"
    last = (done.stderr.strip() or done.stdout.strip() or "no output").splitlines()[-1]
    return done.stdout, f"exit status {done.returncode}: {last}" if done.returncode else ""


def update(mark: Mark, output: str) -> None:
    """Write the tables of the output into the page: those with the same head."""
    made, lines = tables(output.splitlines()), mark.file.read_text().split("\n")
    part = lines[mark.line : mark.end]
    for head, (start, stop) in reversed(tables(part).items()):
        if head in made:
            first, last = made[head]
            part[start:stop] = [line.strip() for line in output.splitlines()[first:last]]
    lines[mark.line : mark.end] = part
    mark.file.write_text("\n".join(lines))


def tables(lines: Sequence[str]) -> dict[tuple[str, int], tuple[int, int]]:
    """Return (head, its how many-th table) → (first, behind the last) line, in order."""
    found, heads = {}, Counter()
    for index in range(1, len(lines)):
        if lines[index].startswith("|") and RULE.fullmatch(lines[index]):
            rows = takewhile(lambda line: line.startswith("|"), lines[index:])
            head = lines[index - 1].strip()
            found[head, heads[head]] = index - 1, index + len(list(rows))
            heads[head] += 1
    return found


def main() -> int:
    """Run the commands; return 1 if a number moved, a command failed or a table has no mark."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    option = parser.add_argument
    option("pages", nargs="*", type=Path, help="pages (default: README.md and docs/*.md)")
    option("--only", choices=("short", "slow"), help="(default: all but slow)")
    option("--update", action="store_true", help="write what moved into the pages")
    option("--list", action="store_true", help="only list commands and tables without a mark")
    options = parser.parse_args()
    pages = [page.resolve() for page in options.pages]
    pages = pages or [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    chosen = defaultdict(list)
    for mark in (mark for page in pages for mark in marks(page)):
        if mark.when in ((options.only,) if options.only else ("", "short")):
            chosen[mark.command].append(mark)
    bare = [(page, line) for page in pages for line in unmarked(page)]
    for page, line in bare:
        print(f"{page.relative_to(ROOT)}:{line}: a table without a mark")
    failed, differences, stale = len(bare), [], []
    for number, (command, own) in enumerate(chosen.items(), 1):
        print(f"[{number}/{len(chosen)}] {command}", flush=True)
        if options.list:
            continue
        output, why = run(command)
        if why:
            failed += 1
            print(f"  {why}", flush=True)
            continue
        for mark in own:
            apart = compare(mark, output)
            differences += apart
            if apart and options.update:
                stale.append((mark, output))
            for one in apart:
                where = f"{one.file.relative_to(ROOT)}:{one.line}"
                print(f"  {where}: {one.old} → {one.new} (± {mark.tolerance:.2g})", flush=True)
    # from the last on, so that the lines of those before stay where they are
    for mark, output in sorted(stale, key=lambda one: -one[0].line):
        update(mark, output)
    print(f"{len(differences)} differences, {failed} other problems", file=sys.stderr)
    return 1 if differences or failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
