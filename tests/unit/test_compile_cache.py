"""What is loaded from disk is the code of this function, for these arguments, as it is now."""

import importlib
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from uam_lab.flight.direct import warm_up
from uam_lab.flight.ros import node_arguments as ros_nodes

pytestmark = pytest.mark.skipif(
    numba.config.DISABLE_JIT, reason="NUMBA_DISABLE_JIT: nothing is compiled"
)

CALLER = """
from uam_control.maths.compiled import jit
import callee
from callee import OFFSET

@jit
def total(x):
    return callee.scaled(x[0]) + x[len(x) - 1] + OFFSET
"""
CALLEE = """
from uam_control.maths.compiled import jit

OFFSET = {offset}

@jit
def scaled(x):
    return {factor} * x
"""
# Waits for all to be ready; prints the result, and how often the cache was hit.
CALL = """
import numpy as np
from caller import total
print("ready", flush=True)
input()
print(total(np.arange(1.0, 4.0).astype({kind!r})), sum(total.stats.cache_hits.values()))
"""


# twice recursive, so that it cannot become part of its caller
RECORD = """
from uam_control.maths.compiled import jit

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
# One record type of `axes` entries; argument: which.
CALL_RECORD = """
import numpy as np
from record import total
def call(axes):
    record = np.zeros(1, [("other", float, axes), ("weight", float, axes)])
    record["weight"] = range(1, axes + 1)
    return total(record, 10.0)
"""


def write(folder: Path, factor: int = 2, offset: int = 10) -> None:
    (folder / "caller.py").write_text(CALLER)
    (folder / "callee.py").write_text(CALLEE.format(factor=factor, offset=offset))


def begin(folder: Path, kind: str = "float64") -> subprocess.Popen:
    code = f"import sys; sys.path.insert(0, {str(folder)!r})" + CALL.format(kind=kind)
    return subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )


def results(*running: subprocess.Popen) -> list[tuple[float, int]]:
    for one in running:
        assert one.stdout.readline() == "ready\n"
    for one in running:
        one.stdin.write("\n")
        one.stdin.flush()
    message = [one.communicate(timeout=120.0)[0].split() for one in running]
    return [(float(total), int(hits)) for total, hits in message]


def result(running: subprocess.Popen) -> tuple[float, int]:
    return results(running)[0]


def test_the_second_process_compiles_nothing(tmp_path):
    write(tmp_path)
    assert result(begin(tmp_path)) == (15.0, 0)
    assert result(begin(tmp_path)) == (15.0, 1)


@pytest.mark.parametrize("change", [{"factor": 5}, {"offset": 13}])
def test_an_edit_of_what_is_called_is_seen_by_the_caller(tmp_path, change):
    write(tmp_path)
    result(begin(tmp_path))
    write(tmp_path, **change)  # caller.py stays
    assert result(begin(tmp_path)) == (18.0, 0)
    files = list(tmp_path.glob("__pycache__/caller.total*.nbc"))
    assert len(files) == 1  # the older one is gone


def test_processes_that_compile_at_once_do_not_take_each_others_code(tmp_path):
    """numba's own numbering gave the code for one kind of array to the other."""
    write(tmp_path)
    kinds = ("float64", "float32", "int64", "int32")
    for hits in (0, 1):
        found = results(*(begin(tmp_path, kind) for kind in kinds))
        assert found == [(15.0, hits)] * len(kinds)


def test_a_process_killed_while_it_wrote_leaves_nothing_that_is_loaded(tmp_path):
    write(tmp_path)
    result(begin(tmp_path))
    for file in tmp_path.glob("__pycache__/*.nbc"):
        file.rename(file.with_name(file.name + ".tmp.0123"))  # as numba writes: then renames
    assert result(begin(tmp_path)) == (15.0, 0)


def test_records_of_two_layouts_compiled_apart_are_distinguished(tmp_path):
    """As the nodes compile the laws, each its own, and the direct engine loads them all."""
    (tmp_path / "record.py").write_text(RECORD)

    def run(code: str) -> list[float]:
        program = f"import sys; sys.path.insert(0, {str(tmp_path)!r})" + CALL_RECORD + code
        out = subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=True
        ).stdout
        return [float(word) for word in out.split()]

    assert run("print(call(2))") == [30.0]
    assert run("print(call(3))") == [60.0]
    assert run("print(call(2), call(3))") == [30.0, 60.0]
    assert run("print(call(3), call(2))") == [60.0, 30.0]


def test_what_is_compiled_is_known_until_an_edit(tmp_path):
    reported = "from caller import total; print(total._cache.filled)"
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); {reported}"

    def filled() -> str:
        return subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout.strip()

    write(tmp_path)
    assert filled() == "False"
    result(begin(tmp_path))
    assert filled() == "True"
    (tmp_path / "caller.py").touch()
    assert filled() == "True"
    write(tmp_path, factor=5)
    assert filled() == "False"


def test_a_warm_up_leaves_nothing_of_the_nodes_to_compile():
    for module in ros_nodes.MODULES.values():
        importlib.import_module(module)
    assert list(warm_up.compiled_functions())
    if warm_up.is_cold():
        warm_up.warm_up()
    assert not warm_up.is_cold()
