"""Search for PX4, its parameters, its log and process; a shell script replaces PX4."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from uam_control.vehicle import load_description
from uam_lab.flights.ros.process_fault_injection import program_of
from uam_sim_bridge.autopilot.params import DEFINITIONS
from uam_sim_bridge.mavlink.telemetry.required_parameters import RequiredParameters
from uam_sim_bridge.px4 import px4_parameters as parameters
from uam_sim_bridge.px4.px4_installation import (
    LOOP_VARIABLE,
    VARIABLE,
    Px4Error,
    Px4Installation,
    Range,
)

SCRIPT = """#!/bin/sh
env | grep ^PX4_ > seen
param() { echo "$*" >> found; }
PATH="$PATH:${R}etc/init.d-posix"
mkdir -p etc/init.d-posix && echo 'echo the original >> found' > etc/init.d-posix/px4-rc.simulator
. px4-rc.simulator
touch "/tmp/px4-sock-$2"
mkdir -p log/today && echo first > log/today/1.ulg && sleep 0.05 && echo second > log/today/2.ulg
echo "arguments $*"
trap 'exit 0' INT
while true; do sleep 0.05; done
"""


# the order of PX4's rcS; `alias` as in PX4's shell
LOOP_SCRIPT = """#!/bin/bash
note() { echo "$*" >> found; }
param() { note "$*"; }
mavlink() { note "mavlink $*"; }
for name in px4-pwm_out_sim px4-sensors px4-commander px4-ekf2; do
    eval "$name() { note $name \\"\\$@\\"; }"
done
px4-listener() {
    note listened
    test "$(grep -c listened found)" -lt 3 && echo never published || echo " timestamp: 1"
}
px4_instance=$2
. px4-rc.simulator
sensors start
commander start
ekf2 start
. px4-rc.mavlink
mkdir -p log && echo first > log/1.ulg
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


def test_without_a_build_each_use_names_its_own_variable(tmp_path, monkeypatch):
    monkeypatch.delenv(LOOP_VARIABLE, raising=False)
    for given in (None, tmp_path):
        with pytest.raises(Px4Error, match=f"--px4-dir DIR or {LOOP_VARIABLE}: .*nolockstep"):
            Px4Installation.find(given, LOOP_VARIABLE)


def test_a_build_without_its_startup_script_is_refused(build):
    (build / "etc" / "init.d-posix" / "rcS").unlink()
    with pytest.raises(Px4Error, match="holds no PX4 build"):
        Px4Installation.find(build)


def test_of_the_sources_builds_the_one_that_the_use_needs_is_taken(build):
    sources = build.parent.parent
    with pytest.raises(Px4Error, match="holds no PX4 build: .*`make px4_sitl_nolockstep`"):
        Px4Installation.find(sources, LOOP_VARIABLE)
    other = shutil.copytree(build, build.with_name("px4_sitl_nolockstep"))
    (build / "px4_boardconfig.h").write_text("#define CONFIG_BOARD_LOCKSTEP 1\n")
    (other / "px4_boardconfig.h").write_text("#define CONFIG_BOARD_NOLOCKSTEP 1\n")
    assert Px4Installation.find(sources, LOOP_VARIABLE).directory == other
    assert Px4Installation.find(sources).directory == build


def test_px4_flies_with_the_stand_ins_rate_loop_and_mocap_alone():
    values = parameters.load(load_description())
    shared = values.keys() & DEFINITIONS.keys()
    assert {"MC_ROLLRATE_P", "THR_MDL_FAC", "CA_ROTOR3_KM", "COM_OF_LOSS_T"} <= shared
    assert values["EKF2_EV_CTRL"] == 11 and values["EKF2_GPS_CTRL"] == 0
    passed = parameters.environment(values)
    assert passed == {"PX4_SYS_AUTOSTART": "10016"}
    script = parameters.start_script(values).splitlines()
    assert "param set EKF2_EV_CTRL 11" in script  # an INT32 parameter: no decimal point
    assert "param set MC_ROLLRATE_P 0.15" in script
    assert not [line for line in script if "SYS_AUTOSTART" in line]
    assert script[2] == ". ${R}etc/init.d-posix/px4-rc.simulator"  # its defaults come first


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("COM_OF_LOSS_T", "NAME=VALUE expected"),
        ("com_of_loss_t=1", "no PX4 parameter name"),
        ("COM_OF_LOSS_T=long", "'long' is not a number"),
        ("COM_OF_LOSS_T=nan", "not a number"),
        ("COM_OF_LOSS_T=99", "99 is out of range; allowed: 0 to 60"),
        ("COM_OF_LOST_T=1", "none of this name"),
        ("SDLOG_MODE=0.5", "0.5 is not an integer"),
        ("MAV_SYS_ID=3", "follows from --instance"),
    ],
)
def test_a_bad_parameter_of_the_command_line_is_refused(text, message):
    with pytest.raises(Px4Error, match=message) as error:
        parameters.parse([text], RANGES)
    assert "\n" not in str(error.value)


RANGES = {"COM_OF_LOSS_T": Range(False, 0.0, 60.0), "SDLOG_MODE": Range(True)}


def test_every_motor_has_an_output():
    """PX4's airframe of a simulated quadrotor has four; without the others a hexacopter falls."""
    six = parameters.motor_outputs(load_description("hexa_arm"))
    assert six == {f"PWM_MAIN_FUNC{n}": 100 + n for n in (1, 2, 3, 4, 5, 6)}


def test_parameters_of_the_command_line_go_before_the_files():
    given = ["COM_OF_LOSS_T=1", "SDLOG_MODE=0"]
    values = parameters.load(load_description(), None, given, RANGES)
    assert repr(values["COM_OF_LOSS_T"]) == "1.0" and repr(values["SDLOG_MODE"]) == "0"
    assert parameters.parse(["ANY_NAME=7"]) == {"ANY_NAME": 7}  # a build without a list


def test_ranges_are_those_of_the_build(build):
    assert Px4Installation(build).ranges() == {}
    (build / "parameters.json").write_text(
        '{"parameters": [{"name": "A", "type": "Int32", "min": -1, "max": 4},'
        ' {"name": "B", "type": "Float"}]}'
    )
    assert Px4Installation(build).ranges() == {"A": Range(True, -1, 4), "B": Range(False)}


def test_the_list_of_required_parameters_of_a_flight(tmp_path):
    values = parameters.load(load_description())
    for in_the_loop in (False, True):
        file = tmp_path / "list.yaml"
        file.write_text(parameters.required(values, in_the_loop))
        rules = RequiredParameters.read(str(file))
        assert rules["COM_LOW_BAT_ACT"].met(0) and not rules["COM_LOW_BAT_ACT"].met(3)
        assert rules["MC_AT_EN"].optional and not rules["EKF2_EV_CTRL"].optional
        assert "SYS_AUTOSTART" not in rules
        assert ("SYS_HITL" in rules) is in_the_loop
        assert ("SIM_BAT_MIN_PCT" in rules) is not in_the_loop


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
                "--param",
                "SDLOG_MODE=4",
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
    assert "PX4_SYS_AUTOSTART=10016" in seen and "PX4_PARAM_MC_ROLL_P=99" not in seen
    found = (folder / "found").read_text().splitlines()  # by PX4's start script
    assert {"set THR_MDL_FAC 0.3", "set SDLOG_MODE 4", "set PWM_MAIN_FUNC4 104"} <= set(found)
    assert found[0] == "the original"
    assert f"arguments -i 7 -d {build / 'etc'}" in _until(output.read_text)
    px4 = psutil.Process(process.pid).children()
    process.send_signal(signum)
    process.wait(10)
    assert psutil.wait_procs(px4, timeout=20.0)[1] == []
    if signum != signal.SIGKILL:
        assert process.returncode == 0 and not folder.exists()
        assert not Path("/tmp/px4-sock-7").exists()
        assert log.read_text() == "first\n"
        assert (tmp_path / "flight-2.ulg").read_text() == "second\n"


def test_in_the_loop_px4_starts_with_its_lines_and_without_a_simulator(build, tmp_path):
    (build / "bin" / "px4").write_text(LOOP_SCRIPT)
    (build / "px4_boardconfig.h").write_text("#define CONFIG_BOARD_NOLOCKSTEP 1\n")
    log, output = tmp_path / "flight.ulg", tmp_path / "output"
    command = [sys.executable, "-m", "uam_sim_bridge.px4.hitl", "-i", "9", "--log", str(log)]
    lines = ["--companion", "/dev/pts/77:460800", "--usb", "/dev/pts/78", "--param", "SDLOG_MODE=4"]
    with output.open("w") as out:
        process = subprocess.Popen(
            [*command, *lines, "--px4-dir", str(build)],
            env=os.environ | {"TMPDIR": str(tmp_path)},
            stdout=out,
            stderr=out,
        )
    _until(lambda: "arguments" in output.read_text())
    (folder,) = tmp_path.glob("uam-px4-*")
    found = (folder / "found").read_text().splitlines()
    assert "the original" not in found  # no simulator at a port
    assert {"set SYS_HITL 1", "set MAV_SYS_ID 1", "set SDLOG_MODE 4"} <= set(found)
    assert {"set PWM_MAIN_FUNC4 104", "set PWM_MAIN_FUNC11 301"} <= set(found)
    assert "px4-pwm_out_sim --instance 9 start -m hil" in found
    for program in ("px4-sensors", "px4-commander"):
        assert f"{program} --instance 9 start -h" in found
    estimator = found.index("px4-ekf2 --instance 9 start")
    assert found[:estimator].count("listened") == 3  # after the first IMU sample
    links = [line for line in found if line.startswith("mavlink start")]
    assert links == [
        "mavlink start -d /dev/pts/77 -b 460800 -m onboard -r 36864",
        "mavlink start -d /dev/pts/78 -b 921600 -m custom -r 73728",
    ]
    process.send_signal(signal.SIGINT)
    assert process.wait(30) == 0 and log.read_text() == "first\n"
    assert not list(tmp_path.glob("uam-px4-*"))


def test_a_build_without_its_gripper_is_named(build):
    Px4Installation(build).require_gripper()  # it does not tell
    board = build / "px4_boardconfig.h"
    board.write_text("#define CONFIG_MODULES_PAYLOAD_DELIVERER 1\n")
    Px4Installation(build).require_gripper()
    board.write_text("#define CONFIG_BOARD_NOLOCKSTEP 1\n")
    with pytest.raises(Px4Error, match="made without CONFIG_MODULES_PAYLOAD_DELIVERER"):
        Px4Installation(build).require_gripper()


@pytest.mark.parametrize(
    ("board", "options", "complaint"),
    [
        ("#define CONFIG_A 1", ["--companion", "/dev/pts/7:921600"], "made with lockstep"),
        ("#define CONFIG_BOARD_NOLOCKSTEP 1", ["--companion", "/dev/pts/7"], "a device and 9600"),
    ],
)
def test_in_the_loop_a_wrong_build_or_line_is_refused(build, board, options, complaint):
    (build / "px4_boardconfig.h").write_text(board)
    done = subprocess.run(
        [sys.executable, "-m", "uam_sim_bridge.px4.hitl", *options, "--px4-dir", str(build)],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 2 and complaint in done.stderr and done.stderr.count("\n") == 1


@pytest.mark.parametrize("signum", [signal.SIGKILL, signal.SIGSEGV, signal.SIGTERM])
def test_a_signal_that_ends_px4_is_named_and_the_log_survives(build, tmp_path, signum):
    log, output = tmp_path / "flight.ulg", tmp_path / "output"
    options = ["-i", "8", "--px4-dir", str(build), "--log", str(log)]
    with output.open("w") as out:
        process = subprocess.Popen(
            [sys.executable, "-m", "uam_sim_bridge.px4.sitl", *options],
            env=os.environ | {"TMPDIR": str(tmp_path)},
            stdout=out,
            stderr=out,
        )
    _until(lambda: "arguments" in output.read_text())
    px4 = psutil.Process(process.pid).children()[0]
    assert program_of("autopilot", process.pid) == px4.pid
    assert program_of("mission", process.pid) == process.pid
    px4.send_signal(signum)
    assert process.wait(20) == -signum
    assert f"PX4 was ended by {signum.name}" in output.read_text()
    assert log.read_text() == "first\n" and not list(tmp_path.glob("uam-px4-*"))
    assert not Path("/tmp/px4-sock-8").exists()


CONNECTS = f"""#!{sys.executable}
import os, pathlib, signal, socket, sys, time
signal.signal(signal.SIGINT, lambda *_: sys.exit(0))
place = os.environ["PX4_SIM_HOSTNAME"], 4560 + int(sys.argv[2])
link = None
while link is None:
    try:
        link = socket.create_connection(place)
    except OSError:
        time.sleep(0.02)
log = pathlib.Path("log/today")
log.mkdir(parents=True)
(log / "1.ulg").write_text(os.getcwd())
while True:  # as PX4: it never connects again
    time.sleep(0.05)
"""


@pytest.mark.parametrize("once", [False, True])
def test_px4_starts_anew_when_the_simulator_hangs_up(build, tmp_path, once):
    (build / "bin" / "px4").write_text(CONNECTS)
    log, number = tmp_path / "flight.ulg", 230
    with socket.create_server(("127.0.0.1", 4560 + number)) as simulator:
        simulator.settimeout(30.0)
        process = subprocess.Popen(
            [
                *(sys.executable, "-m", "uam_sim_bridge.px4.sitl", "-i", f"{number}"),
                *("--px4-dir", str(build), "--log", str(log), *(["--once"] if once else [])),
            ],
            env=os.environ | {"TMPDIR": str(tmp_path)},
            stdout=subprocess.PIPE,
            text=True,
        )
        first, _ = simulator.accept()
        _until(lambda: list(tmp_path.glob("uam-px4-*/log/today/1.ulg")))
        (px4,) = psutil.Process(process.pid).children()
        time.sleep(1.5 if once else 4.0)  # the connection has been seen, by a stalled program too
        first.close()
        if once:
            simulator.settimeout(2.0)
            with pytest.raises(TimeoutError):
                simulator.accept()
            assert px4.is_running()
        else:
            second, _ = simulator.accept()
            assert not px4.is_running()
            _until(lambda: list(tmp_path.glob("uam-px4-*/log/today/1.ulg")))
            second.close()
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=30)[0]
    assert process.returncode == 0
    assert ("starts anew for the next one" in said) is not once
    logs = [file for file in (log, tmp_path / "flight-2.ulg") if file.exists()]
    assert len({file.read_text() for file in logs}) == len(logs) == (1 if once else 2)
    assert not list(tmp_path.glob("uam-px4-*"))


def _until(found, patience=20.0):
    end = time.monotonic() + patience
    while not (value := found()):
        assert time.monotonic() < end
        time.sleep(0.02)
    return value
