"""The first log line of a process does not look at all of its modules."""

import subprocess
import sys

import pytest

PROGRAM = """
import inspect
from rclpy.logging import get_logger
from uam_msgs_py.node import log_callers

{prepare}
looked_at, original = [], inspect.getabsfile
inspect.getabsfile = lambda *given: looked_at.append(given) or original(*given)
get_logger("test").info("first line")
print(len(looked_at))
"""


@pytest.mark.parametrize(("prepare", "first"), [("log_callers.find_modules()", False), ("", True)])
def test_modules_looked_at(prepare: str, first: bool) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(prepare=prepare)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "first line" in done.stderr
    assert (int(done.stdout) > 100) is first
