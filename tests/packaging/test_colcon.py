"""`colcon build`, sourcing install/setup.sh, and what `ros2 run` and `ros2 pkg` then look for."""

import os
import re
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as xml
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
NODES = set(PROJECT["scripts"]) - {"uam"}
PACKAGES = {"uam_control", "uam_lab", "uam_sim_bridge"}  # uam_msgs_py has no executables
HELPFUL = {"autopilot", "px4_sitl", "px4_hitl", "hitl_router"}  # command lines without ROS
PATIENCE = 240.0  # [s] only a failing test waits that long


def executables(workspace):
    """node → its path, as `ros2 pkg executables` finds it: everything in lib/<package>."""
    found = {}
    for package in PACKAGES:
        said = workspace.python(
            f"import ament_index_python as a; print(a.get_package_prefix('{package}'))"
        )
        for file in (Path(said) / "lib" / package).iterdir():
            found[file.name] = file
    return found


def test_the_index_names_every_package_and_its_manifest(workspace):
    for package in (*PACKAGES, "uam", "uam_msgs_py"):
        marker = workspace.prefix / "share/ament_index/resource_index/packages" / package
        assert marker.is_file()
        manifest = xml.parse(workspace.prefix / "share" / package / "package.xml").getroot()
        assert manifest.findtext("name") == package
        assert manifest.findtext("version") == PROJECT["version"]


def test_colcon_test_runs_the_tests(workspace):
    """Without arguments all of them, here those of one file."""
    if workspace.linked:
        pytest.skip("as in the other workspace: the tests are those of src/")
    command = [sys.executable, "-m", "colcon", "test", "--return-code-on-test-failure"]
    command += ["--event-handlers", "console_direct+"]
    command += ["--pytest-args", "tests/unit/test_frames.py"]
    done = subprocess.run(
        command,
        cwd=workspace.folder,
        env=workspace.environment,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"\d+ passed", done.stdout), done.stdout
    assert (workspace.folder / "build/uam/pytest.xml").is_file()


def test_every_node_is_found_and_may_be_run(workspace):
    found = executables(workspace)
    assert set(found) == NODES
    for file in found.values():
        assert file.is_relative_to(workspace.prefix) and os.access(file, os.X_OK)


def test_code_and_configuration_are_those_of_the_workspace(workspace):
    program = "import uam_control as u; from uam_control.settings.configuration import root; "
    code, config = workspace.python(program + "print(u.__file__, root())").split()
    assert Path(code).is_relative_to(workspace.folder)
    assert Path(config).is_relative_to(workspace.folder)
    assert (Path(config) / "profiles" / "s500.yaml").is_file()


def test_the_dependencies_are_reported_for_the_doctor(workspace):
    program = "from importlib import metadata; print(*metadata.requires('uam'), sep='\\n')"
    said = [line for line in workspace.python(program).splitlines() if "extra ==" not in line]
    assert {re.split("[<>=]", line)[0] for line in said} == {
        re.split("[<>=]", line)[0] for line in PROJECT["dependencies"]
    }


def test_every_node_starts(workspace):
    """With a parameter that no node knows, which each refuses by name; or its help.

    One node of each package, and one without ROS; of the others, what they would call is there.
    """
    program = "from importlib.metadata import entry_points as e; "
    loads = "print(*(o.name for o in e(group='console_scripts') if 'uam_' in o.value and o.load()))"
    assert set(workspace.python(program + loads).split()) >= NODES
    found = executables(workspace)
    for name, file in found.items():
        assert f'/bin/{name}" ' in file.read_text()
    chosen = {n: found[n] for n in ("arm_controller", "mavlink_bridge", "scene", "hitl_router")}
    wrong = ["--ros-args", "-p", "no_such_parameter:=1"]
    wrong += ["-p", "autopilot:=udp:127.0.0.1:9"]  # the bridge's port may be another flight's
    surroundings = workspace.environment | {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF",
        "ROS_LOG_DIR": str(workspace.folder / "log"),
        "NUMBA_DISABLE_JIT": "1",  # no node flies here: compiling its steps took a minute
    }

    def start(name):
        command = [chosen[name], *(["--help"] if name in HELPFUL else wrong)]
        options = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "text": True}
        options |= {"stderr": subprocess.STDOUT, "env": surroundings, "timeout": PATIENCE}
        return subprocess.run(command, **options)

    with ThreadPoolExecutor(2) as two:  # all at once would each compile the modules of the others
        ended = dict(zip(chosen, two.map(start, chosen), strict=True))
    for name, done in ended.items():
        if name in HELPFUL:
            assert done.stdout.startswith("usage: ") and done.returncode == 0, done.stdout
        else:
            assert f"{name}: no_such_parameter: unknown" in done.stdout, done.stdout
            assert done.returncode == 2


def test_no_wheel_of_ros_is_pulled_where_ros_is_there():
    """Only the extra `ros` names them; `make setup` leaves it out beside a sourced installation."""
    extras = PROJECT["optional-dependencies"]
    others = [line for name, lines in extras.items() if name != "ros" for line in lines]
    assert [line for line in (*PROJECT["dependencies"], *others) if line.startswith("ros-")] == []
    assert 'test -n "$$ROS_DISTRO" && extras=test' in (ROOT / "Makefile").read_text()
