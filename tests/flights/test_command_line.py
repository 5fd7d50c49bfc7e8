"""Wrong use of `uam fly`: one clear line, exit status 2, nothing written."""

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from uam_lab.cli.main import main
from uam_sim_bridge.ports import Reservation

CSV_HEAD = "t,px,py,pz,yaw,vx,vy,vz,ax,ay,az,dyaw"
ROW = "{t},0,0,1,0,0,0,0,0,0,0,0"
PROFILE = """\
position_controller:
  ros__parameters: {{inertia: {inertia}, lambda_1: [4.0, 4.0, 9.0], lambda_2: [3.0, 3.0, 5.0],
    lambda_table: [1.5, 1.5, 2.0], q_position: [4.0, 4.0, 9.0], q_velocity: [1.0, 1.0, 1.0],
    k_initial: [0.01, 0.01, 0.01, 0.01], nu: [0.5, 2.0, 2.0, 5.0]}}
"""

OPTIONS = [
    (["--scenario", "loop"], "unknown scenario 'loop'; there are: ", ", pick_and_place, "),
    (["--scenario", "no.csv"], "scenario file no.csv does not exist", ""),
    (["--profile", "mine"], "unknown profile 'mine'; there are: ", "s500"),
    (["--controller", "pid"], "controller: 'pid' is not one of modular", ""),
    (
        ["--profile", "asmc1"],
        "profile asmc1 has the law asmc1 for position_controller",
        "--controller asmc1",
    ),
    (["--controller", "asmc2", "--profile", "s500"], "profile s500 has the law modular", "asmc2"),
    (["--engine", "fast"], "engine: 'fast' is not one of ros, direct", ""),
    (["--clock", "wall"], "clock: 'wall' is not one of lockstep, realtime", ""),
    (["--engine", "direct", "--clock", "realtime"], "the direct engine has no clock", ""),
    (["--autopilot", "ardupilot"], "unknown autopilot 'ardupilot'; there are: builtin", ""),
    (["--payload-mass", "heavy"], "'heavy' is not a payload mass: a number in kg, at least 0", ""),
    (["--payload-mass", "-0.1"], "'-0.1' is not a payload mass", "at least 0"),
    (["--payload-mass", "9"], "'9' is not a payload mass: a number in kg", "at most 5"),
    (["--wind", "1", "2"], "--wind: expected 3 arguments", ""),
    (["--wind", "1", "2", "nan"], "'nan' is not a wind: a number in m/s", ""),
    (["--seed", "1.5"], "'1.5' is not a seed: a whole number from 0 to 2147483647", ""),
    (["--seed", "99999999999"], "'99999999999' is not a seed: a whole number from 0 to", ""),
    (["--bogus"], "unrecognized arguments: --bogus", ""),
]
TRAJECTORIES = [
    ("t,px,py\n0,0,0\n", "line 1: column pz", "is missing"),
    (f"{CSV_HEAD}\n{ROW.format(t=0)}\n", "at least two rows", ""),
    (f"{CSV_HEAD}\n{ROW.format(t=0)}\n{ROW.format(t='nan')}\n", "line 3 column t", "finite"),
    (f"{CSV_HEAD}\n{ROW.format(t=1)}\n{ROW.format(t=0.5)}\n", "line 3 column t", "increase"),
    (
        f"{CSV_HEAD},alpha_1\n{ROW.format(t=0)},0\n",
        "line 1: column alpha_2",
        "is missing beside alpha_1",
    ),
    (
        f"{CSV_HEAD},alpha_1,alpha_2,alpha_3\n",
        "column 'alpha_3' is unknown",
        "dyaw,magnet,alpha_1,alpha_2",
    ),
]
PROFILES = [
    ("position_controller: [1, 2\n", "line 2 column 1: not valid YAML", ""),
    ("position_controller: 3\n", "'position_controller' has no 'ros__parameters' mapping", ""),
    (PROFILE.format(inertia="[2.2, 2.2]"), "inertia: a list of 3 numbers expected", ""),
    (PROFILE.format(inertia="[2.2, 2.2, -1.0]"), "position_controller: inertia", "outside"),
    (PROFILE.format(inertia="[2.2, 2.2, 0.0]"), "position_controller: inertia", "outside"),
    (PROFILE.format(inertia="[2.2, .nan, 1.0]"), "position_controller: inertia", "outside"),
    (
        PROFILE.format(inertia="[2.2, 2.2, 2.2]").replace("nu:", "nuu:"),
        "nuu: unknown",
        "did you mean nu?",
    ),
]


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def refused(capsys, *arguments):
    """The one line that `uam fly` says before it returns 2."""
    try:
        status = main(["fly", *arguments])
    except SystemExit as stop:  # argparse
        status = stop.code
    out, err = capsys.readouterr()
    assert status == 2, out + err
    assert out == "" and err.count("\n") == 1, out + err
    return err


@pytest.mark.parametrize(
    ("options", "message", "allowed"), OPTIONS, ids=lambda value: str(value)[:30]
)
def test_a_wrong_option_is_named(capsys, tmp_path, options, message, allowed):
    line = refused(capsys, *options)
    assert message in line and allowed in line
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(("text", "where", "why"), TRAJECTORIES)
def test_a_wrong_trajectory_is_named_with_line_and_column(capsys, tmp_path, text, where, why):
    (tmp_path / "path.csv").write_text(text)
    line = refused(capsys, "--scenario", "path.csv")
    assert "path.csv" in line and where in line and why in line


@pytest.mark.parametrize(("text", "where", "why"), PROFILES)
def test_a_wrong_profile_is_named_with_its_parameter(capsys, tmp_path, text, where, why):
    (tmp_path / "mine.yaml").write_text(text)
    line = refused(capsys, "--profile", "mine.yaml")
    assert "mine.yaml" in line and where in line and why in line


def test_a_result_folder_that_cannot_be_written_is_refused(capsys, tmp_path):
    (tmp_path / "file").touch()
    assert "file" in refused(capsys, "--out", "file")
    assert "/proc/nowhere cannot be written" in refused(capsys, "--out", "/proc/nowhere")


def test_a_folder_with_a_flight_in_it_is_not_overwritten(capsys, tmp_path):
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "metrics.json").write_text("{}")
    assert "already contains a flight" in refused(capsys, "--out", "old")
    assert (tmp_path / "old" / "metrics.json").read_text() == "{}"


def test_a_taken_instance_is_refused_before_anything_flies(capsys, tmp_path):
    with Reservation() as taken:
        number = str(taken.ports.instance)
        line = refused(capsys, "--scenario", "hover", "--instance", number, "--out", "new")
    assert f"instance {number} is not free: reserved by another flight" in line
    assert not (tmp_path / "new").exists()


def test_help_shows_examples(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["fly", "--help"])
    out = capsys.readouterr().out
    assert stop.value.code == 0
    for word in ("examples:", "--scenario", "--clock", "--payload-mass", "Exit status"):
        assert word in out


def test_an_interrupt_while_the_command_loads_is_one_line():
    command = [sys.executable, "-m", "uam_lab.cli.main", "fly", "--scenario", "hover"]
    for _ in range(3):
        with subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        ) as run:
            process = psutil.Process(run.pid)
            # its second child loads the nodes, while it loads the command
            while len(children := process.children()) < 2:
                time.sleep(0.01)
            os.killpg(run.pid, signal.SIGINT)  # as a terminal does
            told, said = run.communicate()
        _, left = psutil.wait_procs(children, timeout=30)
        assert not left
        if not told:  # else this test has stalled, and the interrupted flight tells its results
            break
    assert (run.returncode, told, said) == (130, "", "uam: interrupted\n")
