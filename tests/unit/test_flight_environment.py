"""What the processes of a flight inherit, and what discovery loss needs of it."""

import subprocess
from pathlib import Path

import pytest

from uam_control.settings.configuration import ConfigurationError
from uam_lab.flights import flight_settings
from uam_lab.flights.processes import middleware, node_environment


def test_the_environment_is_private_and_local(tmp_path, monkeypatch):
    monkeypatch.delenv(node_environment.PROFILES_FILE, raising=False)
    monkeypatch.delenv("RMW_IMPLEMENTATION", raising=False)
    made = node_environment.environment(42, tmp_path)
    assert made["ROS_DOMAIN_ID"] == "42"
    assert made["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SYSTEM_DEFAULT"
    assert "<address>127.0.0.1</address>" in Path(made[node_environment.PROFILES_FILE]).read_text()
    assert made["ROS_LOG_DIR"] == str(tmp_path)
    assert made["OMP_NUM_THREADS"] == made["NUMBA_NUM_THREADS"] == "1"


@pytest.mark.parametrize(
    "name, value",
    [
        (node_environment.PROFILES_FILE, "/home/me/mine.xml"),
        ("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp"),
    ],
)
def test_with_the_users_own_middleware_ros_keeps_it_on_this_machine(
    name, value, tmp_path, monkeypatch
):
    monkeypatch.setenv(name, value)
    made = node_environment.environment(42, tmp_path)
    assert made[name] == value and made["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"


def test_a_discovery_server_of_the_users_shell_is_left_out(tmp_path, monkeypatch):
    """With it the nodes of a flight found nothing; ROS reads an empty value as none."""
    monkeypatch.setenv("ROS_DISCOVERY_SERVER", "127.0.0.1:11811")
    assert node_environment.environment(42, tmp_path)["ROS_DISCOVERY_SERVER"] == ""
    assert node_environment.transport_environment()["ROS_DISCOVERY_SERVER"] == ""
    assert "ROS_DISCOVERY_SERVER=''" in node_environment.export_line(42)


def test_threads_of_another_middleware_are_not_known(monkeypatch):
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp")
    assert "supports Fast DDS only, not rmw_cyclonedds_cpp" in node_environment.without_discovery()
    monkeypatch.delenv("RMW_IMPLEMENTATION")
    monkeypatch.setattr(node_environment.thread_stop, "refusal", lambda: "")
    assert node_environment.without_discovery() == ""


def test_the_line_for_ros2_works_when_pasted(monkeypatch, tmp_path):
    """A path with a space and a quote stays one value."""
    odd = str(tmp_path / "it's a prefix")
    monkeypatch.setenv("AMENT_PREFIX_PATH", odd)
    line = node_environment.export_line(17)
    assert "\n" not in line
    shell = ["sh", "-c", f"{line}; env -0"]
    text = subprocess.run(shell, capture_output=True, text=True, check=True).stdout
    found = dict(one.split("=", 1) for one in text.split("\0") if one)
    assert found["ROS_DOMAIN_ID"] == "17"
    assert found["RMW_IMPLEMENTATION"] == middleware.middleware()
    assert found["AMENT_PREFIX_PATH"].split(":")[0] == odd
    for name, value in node_environment.transport_environment().items():
        assert found[name] == value


def test_a_middleware_that_is_not_installed_is_named_before_ros_ends_the_process(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(middleware.sys, "prefix", str(tmp_path / "venv"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "jazzy"))
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp")
    assert middleware.refusal() == "", "no list of what is installed"
    own, sourced = (tmp_path / one / middleware.INDEX for one in ("venv", "jazzy"))
    own.mkdir(parents=True)
    (own / "rmw_fastrtps_cpp").touch()
    (own / "rmw_implementation").touch()
    complaint = (
        "RMW_IMPLEMENTATION=rmw_cyclonedds_cpp is not installed: unset it; "
        "there are: rmw_fastrtps_cpp"
    )
    assert middleware.refusal() == complaint
    monkeypatch.setattr(flight_settings.importlib.util, "find_spec", lambda name: name)
    with pytest.raises(flight_settings.SettingsError, match="is not installed: unset it"):
        flight_settings.require_ros()
    sourced.mkdir(parents=True)
    (sourced / "rmw_cyclonedds_cpp").touch()
    assert middleware.refusal() == ""
    monkeypatch.delenv("RMW_IMPLEMENTATION")
    assert middleware.refusal() == ""


@pytest.mark.parametrize(
    ("surroundings", "arguments", "complaint"),
    [
        (
            {
                "ROS_SECURITY_ENABLE": "true",
                "ROS_SECURITY_STRATEGY": "Enforce",
                "ROS_SECURITY_KEYSTORE": "/no/such/keys",
            },
            [],
            "ROS does not start: SECURITY ERROR: directory '/no/such/keys/enclaves' does not exist"
            "; ROS_SECURITY_ENABLE is true: unset it, or docs/interfaces.md",
        ),
        ({}, ["-r", "uam/state:=x y"], "Couldn't parse remap rule: '-r uam/state:=x y'"),
    ],
)
def test_what_keeps_ros_from_starting_is_an_error_of_the_user(surroundings, arguments, complaint):
    pytest.importorskip("rclpy")
    from uam_lab.flights.processes.guest import Guest

    with pytest.raises(ConfigurationError) as refused:
        Guest("uam_test", {"ROS_SECURITY_ENABLE": "", **surroundings}, arguments=arguments)
    assert complaint in str(refused.value)
    assert "\n" not in str(refused.value) and "/src/rcl" not in str(refused.value)
