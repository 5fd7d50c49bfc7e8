"""Mutation test: inserts small errors into modules, one at a time, and runs their unit tests.

    .venv/bin/python benchmarks/mutants.py                     # all modules of modules.toml
    .venv/bin/python benchmarks/mutants.py laws/ rotations     # those whose path has such a text

An error (a mutant) is killed where a test fails. mutating/modules.toml says which tests judge which
module; mutating/survivors.toml lists the mutants that no test can kill, with the reason. Prints a
table, and every survivor that is not listed. The exit status is 1 where there is one, or where too
few were killed. Needs the extra `mutation` of the project.
"""

from __future__ import annotations

import argparse
import os
import sys
import tomllib
from pathlib import Path

os.environ["NUMBA_DISABLE_JIT"] = "1"  # before numba is imported: mutants are plain Python
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"

from mutating import judge, table
from mutating.mutants import mutants

DATA = Path(__file__).parent / "mutating"
LEAST_TIME, TIMES = 10.0, 10.0  # a mutant may need 10 s, or ten times what the module needs


def main() -> int:
    """Judge the mutants and print the table; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("modules", nargs="*", help="texts that paths must have (default: all)")
    parser.add_argument("--list", action="store_true", help="print the listed survivors only")
    parser.add_argument("-j", type=int, default=2, help="processes (default %(default)s)")
    options = parser.parse_args()
    data = tomllib.loads((DATA / "modules.toml").read_text())
    listed = tomllib.loads((DATA / "survivors.toml").read_text())
    if options.list:
        print(table.survivors_table(listed))
        return 0
    modules = {
        path: tests
        for path, tests in data["modules"].items()
        if not options.modules or any(text in path for text in options.modules)
    }
    if not modules:
        parser.error("no module of modules.toml has such a text in its path")
    sources = {path: (judge.ROOT / path).read_text() for path in modules}
    judge.prepare(data["examples"])

    plain = ((path, path, sources[path], tests, 120.0) for path, tests in modules.items())
    allowed = {}
    for path, status, spent in judge.run(plain, options.j):
        if status != 0:
            sys.exit(f"mutants: the tests of {path} fail without a mutant (status {status})")
        allowed[path] = max(LEAST_TIME, TIMES * spent)

    print(table.HEADER)
    judged: list[table.Judged] = []
    failed = False
    for path, tests in modules.items():
        found = list(mutants(sources[path], data["operators"]))
        jobs = ((one, path, one.source, tests, allowed[path]) for one in found)
        left = [one for one, status, _ in judge.run(jobs, options.j) if status == 0]
        judged.append(table.Judged(path, len(found), left, listed.get(path, [])))
        print(judged[-1].row(), flush=True)
        failed |= complain(judged[-1].complaints())
    print(table.total_row(judged))
    return 1 if complain(table.too_few(judged, data["least_percent"])) or failed else 0


def complain(lines: list[str]) -> bool:
    """Print the lines to stderr; return whether there are any."""
    for line in lines:
        print(line, file=sys.stderr, flush=True)
    return bool(lines)


if __name__ == "__main__":
    raise SystemExit(main())
