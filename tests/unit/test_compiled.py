"""Compiled and plain code are the same function."""

import json
import subprocess
import sys

from uam_control import compiled

PROGRAM = """
import json, sys
if {without_numba}: sys.modules["numba"] = None  # as if it were not installed
from uam_control.rotations import matrix_from_euler
import numpy as np
print(json.dumps(matrix_from_euler(np.array([0.1, -0.2, 0.3])).tolist()))
"""


def run(without_numba: bool) -> list:
    out = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(without_numba=without_numba)],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    return json.loads(out)


def test_without_numba_the_numbers_are_the_same_up_to_rounding():
    fast, plain = run(False), run(True)
    for a, b in zip(sum(fast, []), sum(plain, []), strict=True):
        assert abs(a - b) < 1e-15


def test_identity_without_numba(monkeypatch):
    monkeypatch.setattr(compiled, "numba", None)

    def function(x):
        return 2 * x

    assert compiled.jit(function) is function
