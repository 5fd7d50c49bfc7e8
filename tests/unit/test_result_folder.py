"""The result folder: its name, the link to the newest, refusals, and what is written to it."""

import errno
import json
import os
import subprocess
import sys
from argparse import Namespace
from datetime import datetime

import numpy as np
import pytest
import yaml

from uam_control.settings import atomic
from uam_lab.cli import parser
from uam_lab.records.results import result_folder
from uam_lab.records.results.result_folder import ResultFolder, ResultFolderError, make_folder

NOON = datetime(2026, 3, 1, 12, 0, 5)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_two_flights_of_one_second_get_two_folders_and_latest_is_the_second(here):
    first = ResultFolder.create("pick_and_place", "modular", now=NOON)
    assert str(first.path) == "results/20260301-120005-pick_and_place-modular"
    assert (here / "results/latest").resolve() == (here / first.path).resolve()
    second = ResultFolder.create("my scenarios/My Path.csv", "asmc1", now=NOON)
    assert str(second.path) == "results/20260301-120005-My_Path-asmc1"
    third = ResultFolder.create("pick_and_place", "modular", now=NOON)
    assert str(third.path) == "results/20260301-120005-pick_and_place-modular-2"
    assert os.readlink("results/latest") == "20260301-120005-pick_and_place-modular-2"


@pytest.mark.parametrize("logs", [True, False])
def test_a_refused_flight_leaves_no_folder_and_latest_as_it_was(here, logs):
    latest = here / "results/latest"
    for before in (None, "20260301-120005-hover-modular"):
        refused = ResultFolder.create("circle", "modular", now=NOON)
        if logs:
            (refused.path / "logs").mkdir()
        refused.remove_if_empty()
        assert not refused.path.exists()
        assert (os.readlink(latest) if latest.is_symlink() else None) == before
        flown = ResultFolder.create("hover", "modular", now=NOON)
        result_folder.write_json(flown.metrics, {})
    flown.remove_if_empty()
    assert flown.metrics.exists() and latest.resolve() == flown.path.resolve()


def test_latest_of_a_later_flight_stays_when_an_earlier_one_is_refused(here):
    refused = ResultFolder.create("circle", "modular", now=NOON)
    later = ResultFolder.create("hover", "modular", now=NOON)
    refused.remove_if_empty()
    assert (here / "results/latest").resolve() == later.path.resolve()


def test_latest_that_is_a_folder_of_the_user_stays(here, capsys):
    (here / "results/latest").mkdir(parents=True)
    folder = ResultFolder.create("hover", "modular", now=NOON)
    assert folder.path.is_dir()
    assert not (here / "results/latest").is_symlink()
    assert "is not changed" in capsys.readouterr().err


def test_a_folder_of_the_users_choice_is_used_unless_it_holds_a_flight(here):
    folder = ResultFolder.create("hover", "modular", out=here / "a/b")
    assert folder.path == here / "a/b"
    assert not (here / "results").exists()
    folder.release()  # it has ended and left nothing
    ResultFolder.create("hover", "modular", out=here / "a/b")
    result_folder.write_json(folder.metrics, {"seed": 1})
    with pytest.raises(ResultFolderError, match="already contains a flight"):
        ResultFolder.create("hover", "modular", out=here / "a/b")
    assert json.loads(folder.metrics.read_text()) == {"seed": 1}
    (here / "campaign").mkdir()
    (here / "campaign/report.html").touch()
    with pytest.raises(ResultFolderError, match="or a report; give another --out"):
        ResultFolder.create("hover", "modular", out=here / "campaign")
    inside = ResultFolder.create("hover", "modular", out=here / "results/mine")
    assert (here / "results/latest").resolve() == inside.path


def test_a_folder_that_cannot_be_written_is_refused_in_one_line(here):
    (here / "file").write_text("in the way")
    with pytest.raises(ResultFolderError) as caught:
        ResultFolder.create("hover", "modular", out=here / "file/flight")
    assert str(caught.value) == (
        f"result folder {here}/file/flight cannot be written: not a directory"
    )
    (here / "results").write_text("in the way")
    with pytest.raises(ResultFolderError, match="result folder results cannot be written"):
        ResultFolder.create("hover", "modular")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_is_refused(here):
    (here / "locked").mkdir(mode=0o500)
    with pytest.raises(ResultFolderError, match="permission denied"):
        ResultFolder.create("hover", "modular", out=here / "locked")


def test_files_are_whole_plain_and_readable(here):
    folder = ResultFolder.create("hover", "modular", out=here / "f")
    result_folder.write_json(
        folder.metrics, {"rms": {"position_m": np.array([0.1, np.nan])}, "ok": np.bool_(True)}
    )
    assert json.loads(folder.metrics.read_text()) == {
        "rms": {"position_m": [0.1, None]},
        "ok": True,
    }
    folder.write_parameters({"arm_controller": {"nu": (1.0, 2.0), "lambda_form": "theory"}})
    assert yaml.safe_load(folder.parameters.read_text()) == {
        "arm_controller": {"ros__parameters": {"nu": [1.0, 2.0], "lambda_form": "theory"}}
    }
    result_folder.write_json(folder.versions, result_folder.versions())
    versions = json.loads(folder.versions.read_text())
    assert versions["packages"]["numpy"] == np.__version__
    assert sorted(p.name for p in folder.path.iterdir()) == [
        "metrics.json",
        "parameters.yaml",
        "versions.json",
    ]


def test_an_interrupted_write_leaves_the_old_file(here):
    folder = ResultFolder.create("hover", "modular", out=here / "f")
    result_folder.write_json(folder.metrics, {"seed": 1})
    with pytest.raises(RuntimeError), result_folder.replacing(folder.metrics) as temporary:
        temporary.write_text("{")
        raise RuntimeError
    assert json.loads(folder.metrics.read_text()) == {"seed": 1}
    assert [p.name for p in folder.path.iterdir()] == ["metrics.json"]


def test_the_commit_is_that_of_the_checkout_and_says_when_it_was_edited(tmp_path):
    def git(*arguments):
        identity = ["-c", "user.name=t", "-c", "user.email=t@example.org"]
        command = ["git", "-C", str(tmp_path), *identity, *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    assert result_folder.git_commit(tmp_path) is None
    git("init", "-q")
    (tmp_path / "a.py").write_text("1\n")
    git("add", "a.py")
    git("commit", "-q", "-m", "one")
    head = git("rev-parse", "HEAD")
    assert result_folder.git_commit(tmp_path) == head[:12]
    (tmp_path / "a.py").write_text("2\n")
    assert result_folder.git_commit(tmp_path) == head[:12] + "+changes"
    (tmp_path / "site-packages").mkdir()
    assert result_folder.git_commit(tmp_path / "site-packages") is None


def test_a_full_disk_is_named_with_the_file_and_is_no_wrong_use(here, capsys):
    def fill(options):
        with atomic.replacing(here / "flight" / "metrics.json"):
            raise OSError(errno.ENOSPC, "No space left on device")  # as of a write: no file

    assert parser.run(Namespace(command="fly", run=fill)) == 1
    assert capsys.readouterr().err == (
        f"uam fly: metrics.json is not written, no space left on device in {here}/flight: the "
        "results there are incomplete, and a log may end early\n"
    )
    missing = here / "no such" / "metrics.json"
    assert parser.run(Namespace(command="fly", run=lambda _: atomic.write_text(missing, ""))) == 2


def test_a_device_is_written_and_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with os.fdopen(os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)) as reader:
        atomic.write_text(pipe, "text")
        assert reader.read() == "text"
    assert pipe.is_fifo()


CLAIMS = """
import sys, time
from pathlib import Path
from uam_lab.records.results.result_folder import make_folder
make_folder(Path(sys.argv[1]), "campaign")
print("mine", flush=True)
time.sleep(60)
"""


def test_a_folder_is_of_one_process_until_it_dies(tmp_path):
    """A campaign has it, killed it is free; a flight has it until its release."""
    with subprocess.Popen(
        [sys.executable, "-c", CLAIMS, tmp_path], stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout.readline() == "mine\n"
        for make in (
            lambda: ResultFolder.create("hover", "modular", tmp_path),
            lambda: make_folder(tmp_path, "campaign"),
        ):
            with pytest.raises(ResultFolderError, match="is in use: .* give another --out"):
                make()
        other.kill()
    flight = ResultFolder.create("hover", "modular", tmp_path)
    with pytest.raises(ResultFolderError, match="is in use"):
        ResultFolder.create("hover", "modular", tmp_path)
    flight.release()
    make_folder(tmp_path, "campaign")
    make_folder(tmp_path, "campaign")  # the same process again
