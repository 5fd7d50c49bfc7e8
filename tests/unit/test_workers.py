"""Dask workers of this machine and of a scheduler: lost ones, other versions, the end."""

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest
import tiny_work
from distributed import LocalCluster

from uam_lab.experiments.workers import workers as module
from uam_lab.experiments.workers.identity import difference, identity
from uam_lab.experiments.workers.place import WorkersError, Workplace
from uam_lab.experiments.workers.workers import workers

PATIENCE = 120.0  # [s] on a busy machine


@pytest.fixture(autouse=True)
def importable(monkeypatch):
    """Worker processes import tiny_work from the folder of the tests."""
    folders = [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, folders)))


def test_items_of_two_killed_workers_are_computed_again(tmp_path, monkeypatch):
    prepared = tmp_path / "prepared"
    prepared.mkdir()
    monkeypatch.setenv("PREPARED", str(prepared))
    items = [(str(tmp_path), number) for number in range(20)]
    with workers(Workplace(2), tiny_work.prepare) as crew:
        found = dict(crew.completed(tiny_work.lose_two_workers, items))
    assert {number: result[0] for number, result in found.items()} == {k: k * k for k in range(20)}
    assert (tmp_path / "3").exists() and (tmp_path / "9").exists()
    used = {result[1] for result in found.values()}
    marks = [int(file.name.split("-")[0]) for file in prepared.iterdir()]
    assert used <= set(marks) and len(set(marks)) == len(marks)  # once in each process


def test_workers_of_a_scheduler_give_the_same_and_errors_are_one_line(monkeypatch):
    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address=None,
        silence_logs=50,
    ) as cluster:
        place, said = Workplace(1, cluster.scheduler_address), []
        with workers(place, say=said.append) as crew:
            assert crew.threads() == 2
            assert dict(crew.completed(tiny_work.square, range(30))) == {
                k: k * k for k in range(30)
            }
            with pytest.raises(ValueError, match="item 0 is not possible"):
                list(crew.completed(tiny_work.fail, [0]))
            other = identity() | {"mujoco": "0.1"}
            monkeypatch.setattr(module, "identity", lambda: other)
            with pytest.raises(WorkersError, match=r"has mujoco .*, here 0\.1: install the same"):
                list(crew.completed(tiny_work.square, [1]))


def test_a_scheduler_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setattr(module, "CONNECTING", 0.5)
    with pytest.raises(WorkersError, match="scheduler tcp://127.0.0.1:9: ") as error:
        with workers(Workplace(1, "tcp://127.0.0.1:9")):
            pass
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("reply", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n", b"SSH-2.0-x\r\n"])
def test_a_port_that_is_not_a_scheduler_s_is_named_in_time(monkeypatch, reply):
    monkeypatch.setattr(module, "CONNECTING", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer():
            connection, _ = server.accept()
            with connection:
                connection.sendall(reply)
                connection.recv(1)  # until the other end closes
                time.sleep(2.0)

        threading.Thread(target=answer, daemon=True).start()
        begun, address = time.monotonic(), f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(WorkersError, match=f"scheduler {address}: .*dashboard") as error:
            with workers(Workplace(1, address)):
                pass
    assert "\n" not in str(error.value)
    assert time.monotonic() - begun < 30.0


@pytest.mark.parametrize("error", [OSError(), TypeError("two\nlines"), MemoryError()])
def test_every_failure_to_connect_is_one_line(monkeypatch, error):
    def fail(*_, **__):
        raise error

    monkeypatch.setattr(module, "_LimitedClient", fail)
    with pytest.raises(WorkersError, match="scheduler tls://nowhere:1: [A-Za-z]+; the address"):
        with workers(Workplace(1, "tls://nowhere:1")):
            pass


def test_difference_names_the_first_one():
    assert difference(identity(), identity()) == ""
    assert difference({"numba": "1"}, {}) == "numba None, here 1"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_no_worker_outlives_its_command(number):
    """SIGINT goes to all processes of the terminal, SIGKILL to the command alone.

    The workers leave SIGINT to the command.
    """
    command = [sys.executable, str(Path(tiny_work.__file__))]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    ) as main:
        worker = psutil.Process(int(main.stdout.readline()))
        (blocked,) = re.findall(r"SigBlk:\s+(\w+)", Path(f"/proc/{worker.pid}/status").read_text())
        assert int(blocked, 16) & 1 << (signal.SIGINT - 1)
        children = psutil.Process(main.pid).children(recursive=True)
        assert len(children) >= 2
        (os.killpg if number == signal.SIGINT else os.kill)(main.pid, number)
        assert main.wait(PATIENCE) == -number
        end = time.monotonic() + PATIENCE
        while any(map(psutil.Process.is_running, children)) and time.monotonic() < end:
            time.sleep(0.05)
        assert not [one for one in children if one.is_running()]


def test_a_cluster_that_closes_late_costs_no_result(monkeypatch):
    closed = []

    class Late:
        workers = {}

        def __init__(self, **options):
            """Take what a LocalCluster takes."""

        def close(self, timeout):
            closed.append(timeout)
            raise TimeoutError("not within 5 s")

    monkeypatch.setattr(module, "LocalCluster", Late)
    with module.local_cluster(2):
        """The results are there."""
    assert closed == [module.CLOSING]
    with pytest.raises(ValueError, match="in the block"), module.local_cluster(2):
        raise ValueError("in the block")
