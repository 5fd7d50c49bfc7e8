"""Instances: two flights never share one, and a killed flight leaves its instance free."""

import os
import socket
import subprocess
import sys

import pytest
from loading.conditions import discovery_port

from uam_sim_bridge import ports
from uam_sim_bridge.ports import PortError, Reservation


def test_ports_follow_px4_instances():
    assert ports.ports_of(0) == ports.Ports(0, 1, 4560, 14540, 14580)
    assert ports.ports_of(3) == ports.Ports(3, 4, 4563, 14543, 14583)


def test_instances_do_not_overlap():
    every = [ports.ports_of(i) for i in range(ports.INSTANCES)]
    udp = [p.offboard_udp for p in every] + [p.autopilot_udp for p in every]
    assert len(set(udp)) == len(udp)
    assert all(0 <= p.domain <= 101 for p in every)


def test_two_reservations_differ_and_leave_no_file(tmp_path):
    with Reservation(folder=tmp_path) as first, Reservation(folder=tmp_path) as second:
        assert first.ports.instance != second.ports.instance
        assert len(list(tmp_path.iterdir())) == 2
    assert list(tmp_path.iterdir()) == []


def test_a_taken_instance_is_refused_by_name(tmp_path):
    with Reservation(folder=tmp_path) as first:
        with pytest.raises(PortError, match="reserved by another flight"):
            Reservation(first.ports.instance, folder=tmp_path)
    with Reservation(first.ports.instance, folder=tmp_path) as again:
        assert again.ports == first.ports


def test_the_lock_of_a_killed_flight_vanishes(tmp_path):
    program = (
        "import os, sys, pathlib\n"
        "from uam_sim_bridge.ports import Reservation\n"
        "r = Reservation(folder=pathlib.Path(sys.argv[1]))\n"
        "print(r.ports.instance, flush=True)\n"
        "os.kill(os.getpid(), 9)\n"
    )
    killed = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True
    )
    assert killed.returncode == -9, killed.stderr
    instance = int(killed.stdout)
    with Reservation(instance, folder=tmp_path) as again:
        assert again.ports.instance == instance


def test_a_port_held_by_another_program_is_skipped_and_named(tmp_path):
    with Reservation(folder=tmp_path) as free:
        held = free.ports
    with socket.create_server(("127.0.0.1", held.simulator_tcp)):
        with Reservation(folder=tmp_path) as other:
            assert other.ports.instance != held.instance
        with pytest.raises(PortError, match=f"TCP {held.simulator_tcp}"):
            Reservation(held.instance, folder=tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_flight_is_found_by_instance_and_by_namespace(tmp_path):
    with (
        Reservation(folder=tmp_path, domain=7, namespace="/uav1") as first,
        Reservation(folder=tmp_path, domain=7, namespace="/uav2") as second,
    ):
        assert first.ports.domain == second.ports.domain == 7
        assert first.ports.simulator_tcp != second.ports.simulator_tcp
        number = second.ports.instance
        expected = ports.RunningFlight(number, 7, "/uav2")
        assert ports.flight_of(number, folder=tmp_path) == expected
        assert ports.flight_of(None, "/uav2", folder=tmp_path) == expected
        with pytest.raises(PortError, match=f"choose one by .*{number}: /uav2"):
            ports.flight_of(None, folder=tmp_path)
        assert ports.flight_of(None, "/uav3", folder=tmp_path) is None
        # a domain that the user has set is not that of another flight
        assert ports.flight_of(None, "/uav2", folder=tmp_path, domain=7) == expected
        assert ports.flight_of(None, "/uav2", folder=tmp_path, domain=77) is None
        assert ports.flight_of(None, folder=tmp_path, domain=77) is None
        assert ports.flight_of(number, folder=tmp_path, domain=77) == expected
    assert ports.flight_of(None, folder=tmp_path) is None


def test_one_namespace_of_a_domain_has_one_flight(tmp_path):
    with Reservation(folder=tmp_path, domain=7, namespace="/uav1"):
        with pytest.raises(PortError, match="flies in namespace /uav1 of ROS domain 7 already"):
            Reservation(folder=tmp_path, domain=7, namespace="/uav1")
        assert len(list(tmp_path.iterdir())) == 1
        with Reservation(folder=tmp_path, domain=8, namespace="/uav1"):
            pass


def test_a_ros_program_in_the_domain_does_not_move_a_flight(tmp_path):
    """A ros2 daemon holds the discovery port of the domain that its user works in."""
    instance = 37  # not used by flights beside this test
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as daemon:
        daemon.bind(("127.0.0.1", discovery_port(ports.ports_of(instance).domain)))
        with Reservation(instance, folder=tmp_path) as flight:
            assert flight.ports == ports.ports_of(instance)


def folder(path):
    path.mkdir()


def link(path):
    path.symlink_to("elsewhere")


@pytest.mark.parametrize("make", [folder, link, os.mkfifo])
def test_what_is_no_lock_blocks_its_instance_alone(tmp_path, make):
    with Reservation(folder=tmp_path) as first:
        instance = first.ports.instance
    wrong = ports.lock_file(tmp_path, instance)
    make(wrong)
    with Reservation(folder=tmp_path) as other:
        assert other.ports.instance != instance
    with pytest.raises(PortError, match=rf"instance {instance} is not free: {wrong} is no lock: "):
        Reservation(instance, folder=tmp_path)
    assert wrong.is_symlink() or wrong.exists(), "nothing of the user is removed"
    assert ports.flights(tmp_path) == []
