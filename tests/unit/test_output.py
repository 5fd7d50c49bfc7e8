"""Nothing that is wrong with the terminal, a pipe or a file behind it ends a command's work."""

import os
import subprocess
import sys

import pytest

PROGRAM = """
import sys
from uam_lab.cli import output
from uam_lab.records.results.terminal import Terminal, say
output.begin()
terminal = Terminal()
for _ in range(3):
    say("joint α₁")
    terminal.print("[mm] α₁ ┏")
sys.stdout.write("x" * 100_000)
sys.stdout.flush()
print(repr(output.reason()), sys.stdout.isatty(), file=sys.stderr)
"""


def run(stdout, **environment):
    return subprocess.run(
        [sys.executable, "-c", PROGRAM],
        stdout=stdout,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        env=os.environ | environment,
        check=True,
    )


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252", "utf-8"])
def test_a_letter_that_the_encoding_lacks_is_replaced(tmp_path, encoding):
    with (tmp_path / "said").open("wb") as file:
        assert run(file, PYTHONIOENCODING=encoding).stderr == "'' False\n"
    said = (tmp_path / "said").read_bytes().decode(encoding)
    assert said.startswith("joint α₁\n" if encoding == "utf-8" else "joint ??\n")
    assert said.count("[mm]") == 3 and len(said) > 100_000


def test_a_reader_that_has_ended_is_no_error():
    read, write = os.pipe()
    os.close(read)
    assert run(write).stderr == "'' False\n"
    os.close(write)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="Linux")
def test_a_disk_without_room_is_the_reason():
    with open("/dev/full", "wb") as full:
        assert run(full).stderr == "'no space left on device' False\n"
