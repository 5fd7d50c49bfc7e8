"""uam doctor: instances, their users, and leftovers of crashed flights; with real ports."""

import os
import socket

import pytest

from uam_lab.flights.processes import process_table
from uam_lab.preflight.doctor import instances, leftovers
from uam_lab.preflight.doctor.finding import Verdict
from uam_sim_bridge.ports import INSTANCES, Reservation

OK, WARN, FAIL = Verdict


@pytest.fixture
def free():
    """Ports of an instance that no flight has or takes while the test lasts."""
    with Reservation() as reservation:
        yield reservation.ports


def test_a_busy_port_is_named_with_its_holder(free, tmp_path):
    assert instances.look(free.instance, tmp_path) is None
    with socket.create_server(("127.0.0.1", free.simulator_tcp)):
        busy = instances.look(free.instance, tmp_path)
        assert not busy.flight
        assert f"TCP {free.simulator_tcp} (simulator link), held by " in busy.who
        assert f"(process {os.getpid()})" in busy.who
        (found,) = instances.checks(tmp_path)
        assert found.verdict in (WARN, FAIL) and f"of {INSTANCES} instances" in found.found
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as program:
        program.bind(("127.0.0.1", free.offboard_udp))
        assert (
            f"UDP {free.offboard_udp} (offboard link), held by"
            in instances.look(free.instance, tmp_path).who
        )


def test_another_flight_is_no_trouble(tmp_path):
    with Reservation(folder=tmp_path) as flight:
        busy = instances.look(flight.ports.instance, tmp_path)
        assert busy.flight and f"(process {os.getpid()})" in busy.who


def test_without_a_free_instance_nothing_can_fly(monkeypatch):
    monkeypatch.setattr(instances, "look", lambda n, _: instances.Busy(n, "UDP 1 held by x", False))
    (found,) = instances.checks()
    assert found.verdict is FAIL and "0 of 40" in found.found and "36 more" in found.found


def test_looking_takes_nothing(free, tmp_path):
    instances.look(free.instance, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_locks_without_a_flight_are_named_and_others_left_alone(tmp_path):
    assert leftovers.locks(tmp_path).verdict is OK
    (tmp_path / f"uam-{os.getuid()}-other.lock").touch()
    with Reservation(folder=tmp_path):
        assert leftovers.locks(tmp_path).verdict is OK
    (tmp_path / f"uam-{os.getuid()}-7.lock").touch()
    found = leftovers.locks(tmp_path)
    assert found.verdict is WARN and f"uam-{os.getuid()}-7.lock" in found.found
    assert "other" not in found.found


def test_a_process_is_called_by_its_program():
    assert process_table.name_of(os.getpid()).endswith(f"(process {os.getpid()})")
    nobody = 2**22 + 1
    assert process_table.name_of(nobody) == f"a program (process {nobody})"
