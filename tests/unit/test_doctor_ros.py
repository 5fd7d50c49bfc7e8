"""uam doctor: ROS and its environment, over real processes."""

import pytest

from uam_control.settings import configuration
from uam_lab.preflight.doctor import ros
from uam_lab.preflight.doctor.check_process import Said
from uam_lab.preflight.doctor.finding import Verdict
from uam_sim_bridge.ports import Reservation

OK, WARN, FAIL = Verdict


@pytest.mark.parametrize(
    ("name", "value", "verdict"),
    [
        ("ROS_DOMAIN_ID", "7", OK),
        ("ROS_DOMAIN_ID", "700", WARN),
        ("ROS_DOMAIN_ID", "x", WARN),
        ("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp", OK),
        ("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp", WARN),
        ("FASTRTPS_DEFAULT_PROFILES_FILE", "/no/such/file.xml", FAIL),
        ("FASTRTPS_DEFAULT_PROFILES_FILE", __file__, WARN),
        ("ROS_LOCALHOST_ONLY", "1", WARN),
        ("ROS_LOCALHOST_ONLY", "0", OK),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF", WARN),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST", OK),
        ("ROS_DISCOVERY_SERVER", "127.0.0.1:11811", WARN),
        ("ROS_SECURITY_ENABLE", "true", WARN),
        ("ROS_SECURITY_ENABLE", "false", OK),
        ("ROS_SECURITY_STRATEGY", "Enforce", WARN),
        ("ROS_SECURITY_STRATEGY", "Permissive", OK),
        ("ROS_SECURITY_KEYSTORE", "/no/such/keys", WARN),
        ("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4", WARN),
    ],
)
def test_a_variable_that_is_set_is_judged_by_its_value(name, value, verdict):
    (found,) = ros.variables({name: value, "HOME": "/"})
    assert found.verdict is verdict and f"{name}={value}" in found.found
    assert (found.advice == "") == (verdict is OK)


def test_without_any_of_them_there_is_one_finding():
    (found,) = ros.variables({"ROS_DOMAIN_ID": ""})
    assert found.verdict is OK and "RMW_IMPLEMENTATION" in found.found


def test_two_processes_really_meet():
    rclpy = pytest.importorskip("rclpy")
    with Reservation() as reservation:
        message = ros.measure(reservation.ports.domain)
        found = ros.round_trip(message, reservation.ports.domain)
    assert found.verdict is not FAIL, found
    assert message.facts["file"] == rclpy.__file__ and message.facts["median_s"] > 0.0
    assert f"domain {reservation.ports.domain}" in found.found


def test_an_rclpy_that_cannot_be_imported_fails(tmp_path):
    found = ros.installation(tmp_path / "__init__.py", Said({}, "ImportError: librcl.so"), {})
    assert found.verdict is FAIL and "librcl.so" in found.found and "make setup" in found.advice


def test_messages_that_do_not_come_fail():
    found = ros.round_trip(Said({"file": "x"}, "the two processes did not find each other"), 3)
    assert found.verdict is FAIL and "did not find each other" in found.found


@pytest.mark.parametrize(
    ("surroundings", "rmw", "verdict", "word"),
    [
        ({}, "rmw_fastrtps_cpp", OK, "wheels"),
        ({"ROS_DISTRO": "humble"}, "rmw_fastrtps_cpp", WARN, "humble"),
        ({"ROS_DISTRO": "jazzy"}, "rmw_fastrtps_cpp", WARN, "another installation is sourced"),
        ({}, "rmw_cyclonedds_cpp", WARN, "rmw_cyclonedds_cpp"),
    ],
)
def test_which_installation_it_is(tmp_path, surroundings, rmw, verdict, word):
    site = tmp_path / "site-packages"
    (site / "ros_jazzy_rclpy-7.1.6.dist-info").mkdir(parents=True)
    message = Said({"file": "x", "rmw": rmw})
    found = ros.installation(site / "rclpy" / "__init__.py", message, surroundings)
    assert found.verdict is verdict and word in found.found


def test_apt_and_workspaces_are_distinguished(tmp_path):
    from pathlib import Path

    apt = Path("/opt/ros/jazzy/lib/python3.12/site-packages/rclpy/__init__.py")
    assert ros.kind_of(apt) == "apt, ROS 2 jazzy"
    assert ros.kind_of(tmp_path / "rclpy" / "__init__.py") == "a workspace"


def test_small_receive_buffers_are_reported_with_the_remedy(tmp_path):
    limit = tmp_path / "rmem_max"
    assert ros.room(limit).verdict is OK, "no such file: not Linux"
    limit.write_text("212992\n")
    assert ros.room(limit).verdict is WARN and "rmem_max=4194304" in ros.room(limit).advice
    limit.write_text("4194304\n")
    assert ros.room(limit).verdict is OK
    requested = configuration.path("dds/fastdds.xml").read_text()
    assert f"<receiveBufferSize>{ros.ROOM}</receiveBufferSize>" in requested
