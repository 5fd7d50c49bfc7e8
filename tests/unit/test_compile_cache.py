"""What is loaded from disk is the code of this function, for these arguments, as it is now."""

import importlib
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from fresh_process import FreshProcess
from longer import longer

from uam_lab.flights.direct import warm_up
from uam_lab.flights.ros import node_arguments as ros_nodes

pytestmark = pytest.mark.skipif(
    numba.config.DISABLE_JIT, reason="NUMBA_DISABLE_JIT: nothing is compiled"
)

CALLER = """
import numpy as np
from uam_control.maths.compiled import jit
import callee
from callee import OFFSET

@jit
def total(x):
    return callee.scaled(x[0]) + x[len(x) - 1] + OFFSET

def result(kind):
    # the result, and how often the cache was hit
    found = total(np.arange(1.0, 4.0).astype(kind))
    return float(found), sum(total.stats.cache_hits.values())

def filled():
    return total._cache.filled
"""
CALLEE = """
from uam_control.maths.compiled import jit

OFFSET = {offset}

@jit
def scaled(x):
    return {factor} * x
"""
# twice recursive, so that it cannot become part of its caller
RECORD = """
import numpy as np
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

def of_axes(axes):
    # of one record type with that many entries
    record = np.zeros(1, [("other", float, axes), ("weight", float, axes)])
    record["weight"] = range(1, axes + 1)
    return total(record, 10.0)
"""

# the same source with two functions
CLOSURE = """
import numpy as np
from uam_control.maths.compiled import jit

@jit
def double(x):
    return {double} * x

@jit
def half(x):
    return 0.5 * x

def with_step(step):
    @jit
    def stepped(x):
        return step(x[0])
    return stepped

def result(name):
    stepped = with_step(globals()[name])
    return float(stepped(np.array([10.0]))), sum(stepped.stats.cache_hits.values())
"""


# the function is in another file than the class of its argument
FIELDS = """
from typing import NamedTuple
import numpy as np
from uam_control.maths.compiled import jit
from reader import read

class Pair(NamedTuple):
    {fields[0]}: float
    {fields[1]}: float

def result():
    return read(Pair(1.0, 2.0)), sum(read.stats.cache_hits.values())
"""
READER = """
from uam_control.maths.compiled import jit

@jit
def read(pair):
    return pair.first
"""


def write(folder: Path, factor: int = 2, offset: int = 10) -> None:
    (folder / "caller.py").write_text(CALLER)
    (folder / "callee.py").write_text(CALLEE.format(factor=factor, offset=offset))


@pytest.fixture
def start(tmp_path):
    """start(module) returns a process that has imported this module of tmp_path."""
    running = []

    def begin(module="caller"):
        running.append(FreshProcess(tmp_path, module))
        return running[-1]

    yield begin
    for process in running:
        process.end()


def test_the_second_process_compiles_nothing(tmp_path, start):
    write(tmp_path)
    assert start().call("result", "float64") == (15.0, 0)
    assert start().call("result", "float64") == (15.0, 1)


@pytest.mark.parametrize("change", [{"factor": 5}, longer({"offset": 13})])
def test_an_edit_of_what_is_called_is_seen_by_the_caller(tmp_path, change, start):
    write(tmp_path)
    start().call("result", "float64")
    write(tmp_path, **change)  # caller.py stays
    assert start().call("result", "float64") == (18.0, 0)
    files = list(tmp_path.glob("__pycache__/caller.total*.nbc"))
    assert len(files) == 1  # the older one is gone


def test_processes_that_compile_at_once_do_not_take_each_others_code(tmp_path, start):
    """numba's own numbering gave the code for one kind of array to the other."""
    write(tmp_path)
    kinds = ("float64", "float32", "int64", "int32")
    for hits in (0, 1):
        running = [start() for _ in kinds]
        for process, kind in zip(running, kinds, strict=True):
            process.begin("result", kind)
        assert [process.answer() for process in running] == [(15.0, hits)] * len(kinds)


def test_a_process_killed_while_it_wrote_leaves_nothing_that_is_loaded(tmp_path, start):
    write(tmp_path)
    start().call("result", "float64")
    for file in tmp_path.glob("__pycache__/*.nbc"):
        file.rename(file.with_name(file.name + ".tmp.0123"))  # as numba writes: then renames
    assert start().call("result", "float64") == (15.0, 0)


@pytest.mark.parametrize(
    "content", [b"no pickle", longer(b""), longer(b"cmoved.away\nArguments\n.")]
)
def test_a_file_that_cannot_be_read_is_compiled_again(tmp_path, content, start):
    """As a file of a version in which a class of the arguments was in another module."""
    write(tmp_path)
    start().call("result", "float64")
    for file in tmp_path.glob("__pycache__/caller.*.nbc"):
        file.write_bytes(content)
    assert start().call("result", "float64") == (15.0, 0)
    assert start().call("result", "float64") == (15.0, 1)


def test_a_function_with_two_inner_functions_has_the_code_of_each(tmp_path, start):
    """As the compiled ticks of the direct engine, with the step of a law."""
    (tmp_path / "closure.py").write_text(CLOSURE.format(double=2))
    for hits in (0, 1):
        process = start("closure")
        assert process.call("result", "double") == (20.0, hits)
        assert process.call("result", "half") == (5.0, hits)
    (tmp_path / "closure.py").write_text(CLOSURE.format(double=3))
    assert start("closure").call("result", "double") == (30.0, 0)


def test_records_of_two_layouts_compiled_apart_are_distinguished(tmp_path, start):
    """As the nodes compile the laws, each its own, and the direct engine loads them all."""
    (tmp_path / "record.py").write_text(RECORD)
    for order in ((2,), (3,), (2, 3), (3, 2)):
        process = start("record")
        assert [process.call("of_axes", axes) for axes in order] == [
            {2: 30.0, 3: 60.0}[axes] for axes in order
        ]


def test_a_named_tuple_is_known_by_its_fields_and_its_module(tmp_path, start):
    """numba's key has neither: with older code the fields are exchanged, or nothing loads."""
    (tmp_path / "reader.py").write_text(READER)
    (tmp_path / "old.py").write_text(FIELDS.format(fields=("first", "second")))
    assert start("old").call("result") == (1.0, 0)
    assert start("old").call("result") == (1.0, 1)
    (tmp_path / "old.py").write_text(FIELDS.format(fields=("second", "first")))
    assert start("old").call("result") == (2.0, 0)
    (tmp_path / "old.py").rename(tmp_path / "new.py")
    assert start("new").call("result") == (2.0, 0)


def test_what_is_compiled_is_known_until_an_edit(tmp_path, start):
    write(tmp_path)
    assert not start().call("filled")
    start().call("result", "float64")
    assert start().call("filled")
    (tmp_path / "caller.py").touch()
    assert start().call("filled")
    write(tmp_path, factor=5)
    assert not start().call("filled")


def test_a_warm_up_leaves_nothing_of_the_nodes_to_compile():
    for module in ros_nodes.MODULES.values():
        importlib.import_module(module)
    assert list(warm_up.compiled_functions())
    warm_up.prepare()
    assert not warm_up.is_cold()


LATE_FLIGHT = """
from uam_control.mission import load_scenario
from uam_control.profiles.profile import default_profile
from uam_lab.flights.direct import warm_up
from uam_lab.flights.direct.flight import DirectFlight
from uam_sim_bridge.faults.schedule import read_schedule
from uam_sim_bridge.plant import Vehicle

assert not warm_up.is_cold()
scenario = load_scenario("quick_pick")
late = read_schedule(["mocap_latency@0.5+1:delay=0.03", "mocap_dropout@2+0.3"], scenario, seed=2)
flight = DirectFlight(scenario, default_profile("modular"), Vehicle.load(), 0.2, 2, late)
for _ in range(1250):
    flight.tick()
used = [one for one in warm_up.compiled_functions() if one.stats.cache_hits]
missed = [one.__name__ for one in warm_up.compiled_functions() if one.stats.cache_misses]
print(len(used), missed)
"""


def test_a_flight_with_late_poses_in_a_later_process_compiles_nothing():
    warm_up.prepare()
    done = subprocess.run(
        [sys.executable, "-c", LATE_FLIGHT], capture_output=True, text=True, check=True
    )
    used, missed = done.stdout.split(" ", 1)
    assert int(used) > 20 and missed.strip() == "[]"
