"""Whether numba's own cache on disk can replace `uam_control.maths.compile_cache`.

    .venv/bin/python benchmarks/compile_cache.py

Three situations, each with `numba.njit(cache=True)` and with `jit`:

- edited: a function is called after an edit of another function that it calls,
- records: two processes compile one function for a record type each, a third process loads both,
- at_once: four processes compile one function for four types at once; the count of wrong results.

Prints the results and the right ones.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

CACHES = {
    "numba": "from functools import partial\nimport numba\njit = partial(numba.njit, cache=True)\n",
    "ours": "from uam_control.maths.compiled import jit\n",
}
CALLEE = "@jit\ndef scaled(x):\n    return {factor} * x\n"
CALLER = "from callee import scaled\n@jit\ndef total(x):\n    return scaled(x[0]) + x[len(x) - 1]\n"
# Twice recursive, so that numba does not inline it into its caller.
RECORD = """
@jit
def weighted(p, i, x):
    if i < 0:
        return 0.0
    return p.weight[i] * x + weighted(p, i - 1, x) + 0.0 * weighted(p, i - 2, x)

@jit
def total(record, x):
    p = record[0]
    return weighted(p, len(p.weight) - 1, x)
"""
CALL_RECORD = """
import numpy as np
from record import total
def call(axes):
    record = np.zeros(1, [("other", float, axes), ("weight", float, axes)])
    record["weight"] = range(1, axes + 1)
    return total(record, 10.0)
"""
CALL = "import numpy as np; from caller import total; print(total(np.arange(1, 4).astype({!r})))"
RUNS = 5  # of the processes that compile at once


def begin(folder: Path, code: str) -> subprocess.Popen:
    """A process that runs `code` with the modules of `folder`."""
    program = f"import sys; sys.path.insert(0, {str(folder)!r})\n{code}"
    return subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)


def end(process: subprocess.Popen) -> list[float]:
    """What it printed; [] where it crashed."""
    return [float(word) for word in process.communicate()[0].split()]


def edited(folder: Path, cache: str) -> list[float]:
    """The caller before and after an edit of the function that it calls."""
    (folder / "caller.py").write_text(cache + CALLER)
    found = []
    for factor in (2, 50):
        (folder / "callee.py").write_text(cache + CALLEE.format(factor=factor))
        found += end(begin(folder, CALL.format("float64")))
    return found


def records(folder: Path, cache: str) -> list[float]:
    """Two record types in a process that loads what two others have compiled."""
    (folder / "record.py").write_text(cache + RECORD)
    for axes in (2, 3):
        end(begin(folder, CALL_RECORD + f"print(call({axes}))"))
    return end(begin(folder, CALL_RECORD + "print(call(2), call(3))"))


def at_once(folder: Path, cache: str) -> list[float]:
    """Wrong results, of four processes that start together, then load what is there."""
    (folder / "caller.py").write_text(cache + CALLER)
    (folder / "callee.py").write_text(cache + CALLEE.format(factor=2))
    wrong = 0
    for _ in range(RUNS):
        for file in folder.glob("__pycache__/*.nb*"):
            file.unlink()
        for _ in range(2):
            kinds = ("float64", "float32", "int64", "int32")
            running = [begin(folder, CALL.format(kind)) for kind in kinds]
            wrong += sum(end(process) != [5.0] for process in running)
    return [float(wrong)]


def main() -> None:
    """Run and print."""
    situations = {edited: [5.0, 53.0], records: [30.0, 60.0], at_once: [0.0]}
    for situation, right in situations.items():
        for name, cache in CACHES.items():
            with tempfile.TemporaryDirectory() as folder:
                found = situation(Path(folder), cache)
            print(f"{situation.__name__:<8} {name:<6} {found}, right: {right}", flush=True)


if __name__ == "__main__":
    main()
