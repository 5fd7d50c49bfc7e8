"""What a command refuses is one line; a mistake of the program is raised."""

import signal
import subprocess
import sys
import time
import tomllib
from argparse import Namespace
from pathlib import Path

import pytest

from uam_control.settings.configuration import ConfigurationError
from uam_lab import executables
from uam_lab.cli.main import main
from uam_lab.cli.parser import run
from uam_lab.executables import interrupt

ROOT = Path(__file__).resolve().parents[2]
ENTRY = "uam_lab.executables:main"


def test_an_error_of_the_project_or_the_system_is_one_line(capsys):
    for error, text in (
        (ConfigurationError("a.yaml:\nx is 7"), "a.yaml:␊x is 7"),
        (FileNotFoundError(2, "No such file", "b.csv"), "[Errno 2] No such file: 'b.csv'"),
    ):

        def refuse(_, error=error):
            raise error

        assert run(Namespace(command="fly", run=refuse)) == 2
        assert capsys.readouterr().err == f"uam fly: {text}\n"


def test_a_mistake_of_the_program_is_raised():
    with pytest.raises(ZeroDivisionError):
        run(Namespace(command="fly", run=lambda _: 1 / 0))


def test_an_import_that_ctrl_c_ends_is_an_interrupt_whatever_it_says(capsys):
    def interrupted(_):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise ImportError("initialization failed") from error

    assert run(Namespace(command="margins", run=interrupted)) == 130
    assert capsys.readouterr().err == "uam margins: interrupted\n"


def test_processes_that_begin_with_a_command_do_not_hear_ctrl_c():
    """MuJoCo's import starts one; the terminal's Ctrl-C is sent to all, and its words are Python's.

    The command still hears it.
    """
    program = """
import signal, subprocess

heard, start = [], subprocess.Popen.__init__

def counted(*arguments, **options):
    heard.append(signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, []))
    start(*arguments, **options)

subprocess.Popen.__init__ = counted
from uam_lab.cli.main import main

try:
    main(["margins", "--help"])
finally:
    print(heard.count(True), signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "0 False", done.stderr


def test_ctrl_c_that_a_compilation_would_lose_comes_behind_it():
    passed = []

    def _raw_object_cache_notify():  # as llvmlite's, which LLVM calls
        signal.raise_signal(signal.SIGINT)
        passed.append("whole")

    before = signal.signal(signal.SIGINT, interrupt)
    try:
        with pytest.raises(KeyboardInterrupt):
            _raw_object_cache_notify()
            time.sleep(10.0)
    finally:
        signal.signal(signal.SIGINT, before)
    assert passed == ["whole"]


def test_ctrl_c_while_a_node_loads_ends_it_without_a_word():
    program = """
import importlib, sys, time
from uam_lab.executables import main

def load(module):
    print(module, flush=True)
    time.sleep(20.0)

importlib.import_module, sys.argv = load, ["bin/position_controller"]
main()
"""
    node = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert node.stdout.readline() == "uam_control.nodes.position_controller\n"
    node.send_signal(signal.SIGINT)
    assert node.communicate(timeout=20.0) == ("", "")
    assert node.returncode == -signal.SIGINT


def test_every_executable_has_its_module():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    scripts = {name for name, entry in project["scripts"].items() if entry == ENTRY}
    assert scripts == executables.MODULES.keys() == project["scripts"].keys() - {"uam"}


def test_an_empty_name_is_not_the_present_folder(capsys):
    for command in (["fly", "--out", ""], ["report", " "]):
        with pytest.raises(SystemExit):
            main(command)
        assert "the name is empty" in capsys.readouterr().err
