"""A closed terminal ends a flight in order; nohup keeps it."""

import os
import pty
import signal
import subprocess
import sys
import time

import pytest

PROGRAM = """
import sys, time
from pathlib import Path
from uam_lab.flights.processes import child
from uam_lab.flights.processes.interrupts import Interrupts
from multiprocessing import forkserver

child.prepare([])
with Interrupts() as stop:
    print("ready", flush=True)
    end = time.monotonic() + float(sys.argv[2])
    while not stop.raised and time.monotonic() < end:
        time.sleep(0.02)
    for _ in range(100):
        print("in order " * 100, flush=True)  # to a terminal that is gone
    forkserver.ensure_running()
Path(sys.argv[1]).write_text(str(stop.count))
"""
PATIENCE = 60.0  # [s]


def begin(tmp_path, seconds, output, **options):
    command = [sys.executable, "-c", PROGRAM, str(tmp_path / "count"), str(seconds)]
    return subprocess.Popen(command, stdin=output, stdout=output, stderr=output, **options)


def until_ready(read):
    text, end = b"", time.monotonic() + PATIENCE
    while b"ready" not in text:
        assert time.monotonic() < end, text
        text += read()


def test_a_closed_terminal_ends_in_order(tmp_path):
    ours, theirs = pty.openpty()

    def lead():
        signal.signal(signal.SIGHUP, signal.SIG_DFL)  # the tests may run below nohup
        os.setsid()
        os.ttyname(0)  # the terminal of a session leader becomes its controlling one
        os.close(os.open(os.ttyname(0), os.O_RDWR))

    program = begin(tmp_path, PATIENCE, theirs, preexec_fn=lead)
    os.close(theirs)
    until_ready(lambda: os.read(ours, 1000))
    os.close(ours)
    assert program.wait(PATIENCE) == 0
    assert int((tmp_path / "count").read_text()) >= 1


@pytest.mark.parametrize(("ignored", "count"), [(True, 0), (False, 1)])
def test_nohup_is_obeyed(tmp_path, ignored, count):
    def without_hangup():
        signal.signal(signal.SIGHUP, signal.SIG_IGN if ignored else signal.SIG_DFL)

    log = (tmp_path / "log").open("w+b")
    program = begin(tmp_path, 3.0, log, preexec_fn=without_hangup)
    until_ready(lambda: (tmp_path / "log").read_bytes())
    program.send_signal(signal.SIGHUP)
    assert program.wait(PATIENCE) == 0
    assert (tmp_path / "count").read_text() == str(count)
    log.close()
