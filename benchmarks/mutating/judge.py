"""Whether tests notice a mutant: they are run in a forked process that imports it.

A test run of its own needs two seconds to import numpy, numba and pytest, and a tenth of a second
for the tests. Here they are imported once; every mutant is a fork of this process, in which the
import system hands out the mutated source. No file is changed.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import importlib.abc
import importlib.util
import multiprocessing
import os
import resource
import sys
import time
from collections.abc import Iterable, Iterator
from importlib.machinery import ModuleSpec, SourceFileLoader
from multiprocessing.connection import wait
from pathlib import Path
from types import CodeType

import pytest
from hypothesis import Phase, settings

ROOT = Path(__file__).resolve().parents[2]
# imported before the first fork: nothing of them is mutated
LIBRARIES = ("numpy", "numba", "scipy.linalg", "scipy.optimize", "mujoco", "yaml", "hypothesis")
PACKAGES = ("uam_control", "uam_msgs_py", "uam_sim_bridge", "uam_lab")
MEMORY = 4 << 30  # [B] that a mutant may use
FORK = multiprocessing.get_context("fork")


class Mutated(importlib.abc.MetaPathFinder, SourceFileLoader):
    """Imports one module from a source text instead of its file."""

    def __init__(self, path: str, source: str) -> None:
        """path: of the module, from the root of the project."""
        super().__init__(path.removesuffix(".py").replace("/", "."), str(ROOT / path))
        self._source = source

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """See `importlib.abc.MetaPathFinder`."""
        if name != self.name:
            return None
        return importlib.util.spec_from_file_location(name, self.path, loader=self)

    def get_code(self, fullname: str) -> CodeType:
        """See `importlib.abc.InspectLoader`."""
        return self.source_to_code(self._source, self.path)


def prepare(examples: int) -> None:
    """Import what every test needs; examples: of hypothesis for each property."""
    assert os.environ.get("NUMBA_DISABLE_JIT") == "1", "compiled code would not be mutated"
    for name in LIBRARIES:
        importlib.import_module(name)
    sys.path[:0] = [str(ROOT), str(ROOT / "tests")]
    settings.register_profile(
        "mutants",
        deadline=None,
        derandomize=True,
        database=None,
        max_examples=examples,
        phases=(Phase.explicit, Phase.generate),
    )
    settings.load_profile("mutants")
    gc.collect()
    gc.freeze()  # a child does not touch what is shared with it


def notices(path: str, source: str, tests: list[str]) -> None:
    """Run the tests on a mutant, in a process of its own; it exits with 0 where they all pass."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1), os.dup2(silent, 2)
    loaded = [name for name in sys.modules if name.split(".")[0] in PACKAGES]
    assert not loaded, f"imported before the mutant: {loaded}"
    sys.meta_path.insert(0, Mutated(path, source))
    os.chdir(ROOT)
    files = [f"tests/unit/{name}.py" for name in tests]
    options = ["-x", "-q", "--tb=no", "--noconftest"]
    options += ["-p", "no:cacheprovider", "-p", "no:unraisableexception"]
    status = 1
    with contextlib.suppress(BaseException):
        status = pytest.main([*options, *files])
    os._exit(int(status))


def run(
    jobs: Iterable[tuple[object, str, str, list[str], float]], processes: int
) -> Iterator[tuple[object, int | None, float]]:
    """Yield (key, exit status or None for one that hung, seconds) of each job as it ends.

    jobs: (key, path of the module, its source, names of the test files, time allowed [s]).
    """
    running: dict[int, tuple] = {}
    pending = iter(jobs)
    exhausted = False
    while running or not exhausted:
        while not exhausted and len(running) < processes:
            job = next(pending, None)
            if job is None:
                exhausted = True
                break
            key, path, source, tests, allowed = job
            child = FORK.Process(target=notices, args=(path, source, tests))
            child.start()
            running[child.sentinel] = (key, child, time.monotonic(), allowed)
        if running:
            wait(list(running), timeout=0.5)
        for sentinel, (key, child, begin, allowed) in list(running.items()):
            spent = time.monotonic() - begin
            if child.exitcode is None and spent < allowed:
                continue
            status = child.exitcode
            if status is None:
                child.kill()
            child.join()
            del running[sentinel]
            yield key, status, spent
