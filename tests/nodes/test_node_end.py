"""The end of a node's process when the middleware hangs: seen once, with many nodes at once."""

import subprocess
import sys
import time

HANGING = """
import signal, sys, threading, time
import rclpy.node
from uam_msgs_py.node import base_node

base_node.END_PATIENCE = float(sys.argv.pop(1))

class Hanging(base_node.UamNode):
    def settle(self):
        signal.raise_signal(signal.SIGINT)

    def destroy_node(self):
        print("own work done", flush=True)
        super().destroy_node()

if sys.argv.pop(1) == "hang":
    rclpy.node.Node.destroy_node = lambda self: time.sleep(600.0)
print("status", base_node.run(lambda: Hanging("hanging"), "hanging"), flush=True)
time.sleep(base_node.END_PATIENCE + 0.5)  # the guard is over
"""
PATIENCE = 60.0  # [s]


def ended(how, patience):
    command = [sys.executable, "-c", HANGING, str(patience), how]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)


def test_a_hanging_middleware_does_not_keep_the_process(domain):
    begun = time.monotonic()
    done = ended("hang", 1.0)
    assert done.returncode == 1 and done.stdout == "own work done\n"
    assert "Timeout" in done.stderr and "destroy_node" in done.stderr  # where it hung
    assert time.monotonic() - begun < PATIENCE


def test_a_usual_end_is_not_touched(domain):
    done = ended("usual", 4.0)  # a stalled end is a usual one, too
    assert (done.returncode, done.stdout) == (0, "own work done\nstatus 0\n"), done.stderr
    assert done.stderr == ""
