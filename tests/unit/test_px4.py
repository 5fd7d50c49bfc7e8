"""Search for PX4, its parameters, its log and process; a shell script replaces PX4."""

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from uam_control.vehicle import load_description
from uam_sim_bridge.autopilot.params import DEFINITIONS
from uam_sim_bridge.px4 import px4_parameters as parameters
from uam_sim_bridge.px4.px4_installation import VARIABLE, Px4Error, Px4Installation

SCRIPT = """#!/bin/sh
env | grep ^PX4_ > seen
mkdir -p log/today && echo first > log/today/1.ulg && sleep 0.05 && echo second > log/today/2.ulg
echo "arguments $*"
trap 'exit 0' INT
while true; do sleep 0.05; done
"""


@pytest.fixture
def build(tmp_path):
    """Return a directory with the files of a PX4 build."""
    folder = tmp_path / "build" / "px4_sitl_default"
    (folder / "bin").mkdir(parents=True)
    (folder / "etc" / "init.d-posix").mkdir(parents=True)
    (folder / "etc" / "init.d-posix" / "rcS").touch()
    (folder / "bin" / "px4").write_text(SCRIPT)
    (folder / "bin" / "px4").chmod(0o755)
    return folder


def test_a_build_is_found_in_itself_in_its_sources_and_by_the_variable(build, monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    assert Px4Installation.find(build).directory == build
    assert Px4Installation.find(build.parent.parent).directory == build
    monkeypatch.setenv(VARIABLE, str(build))
    assert Px4Installation.find().binary == build / "bin" / "px4"


def test_no_build_is_refused_in_one_line(tmp_path, monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    for given in (None, tmp_path, tmp_path / "nothing"):
        with pytest.raises(Px4Error, match="bin/px4 and etc/") as error:
            Px4Installation.find(given)
        assert "\n" not in str(error.value)


def test_a_build_without_its_startup_script_is_refused(build):
    (build / "etc" / "init.d-posix" / "rcS").unlink()
    with pytest.raises(Px4Error, match="holds no PX4 build"):
        Px4Installation.find(build)


def test_px4_flies_with_the_stand_ins_rate_loop_and_mocap_alone():
    values = parameters.load(load_description())
    shared = values.keys() & DEFINITIONS.keys()
    assert {"MC_ROLLRATE_P", "THR_MDL_FAC", "CA_ROTOR3_KM", "COM_OF_LOSS_T"} <= shared
    assert values["EKF2_EV_CTRL"] == 11 and values["EKF2_GPS_CTRL"] == 0
    passed = parameters.environment(values)
    assert passed["PX4_SYS_AUTOSTART"] == "10016" and "PX4_PARAM_SYS_AUTOSTART" not in passed
    assert passed["PX4_PARAM_EKF2_EV_CTRL"] == "11"  # an INT32 parameter: no decimal point
    assert passed["PX4_PARAM_MC_ROLLRATE_P"] == "0.15"


@pytest.mark.parametrize(
    "text, message",
    [
        ("[1, 2]", "NAME: value"),
        ("mc_roll_p: 1.0", "no PX4 parameter name"),
        ("MC_ROLL_P: high", "not a number"),
        ("MC_ROLL_P: .nan", "not a number"),
        ("A: [", "not valid YAML"),
        ("A_NAME_THAT_IS_TOO_LONG: 1", "no PX4 parameter name"),
    ],
)
def test_bad_parameters_are_refused(text, message, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(Px4Error, match=message):
        parameters.load(load_description(), [file])


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_nothing_is_left_but_the_logs(build, tmp_path, signum):
    log, output = tmp_path / "flight.ulg", tmp_path / "output"
    with output.open("w") as out:
        process = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "uam_sim_bridge.px4.sitl",
                "-i",
                "7",
                "--px4-dir",
                str(build),
                "--log",
                str(log),
            ],
            env=os.environ | {"PX4_PARAM_MC_ROLL_P": "99", "TMPDIR": str(tmp_path)},
            stdout=out,
            stderr=out,
        )
    folder = _until(
        lambda: [
            f
            for f in tmp_path.glob("uam-px4-*")
            if (f / "log/today/2.ulg").exists() and (f / "log/today/2.ulg").read_text()
        ]
    )[0]
    seen = (folder / "seen").read_text()
    assert "PX4_PARAM_THR_MDL_FAC=0.3" in seen and "PX4_PARAM_MC_ROLL_P=99" not in seen
    assert f"arguments -i 7 -d {build / 'etc'}" in _until(output.read_text)
    px4 = psutil.Process(process.pid).children()
    process.send_signal(signum)
    process.wait(10)
    assert psutil.wait_procs(px4, timeout=20.0)[1] == []
    if signum != signal.SIGKILL:
        assert process.returncode == 0 and not folder.exists()
        assert log.read_text() == "first\n"
        assert (tmp_path / "flight-2.ulg").read_text() == "second\n"


def _until(found, patience=20.0):
    end = time.monotonic() + patience
    while not (value := found()):
        assert time.monotonic() < end
        time.sleep(0.02)
    return value
