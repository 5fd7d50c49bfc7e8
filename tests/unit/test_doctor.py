"""uam doctor: verdicts, all groups of checks, and the command line."""

import contextlib
import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from importlib import metadata

import pytest
from arm_rig import BAUD, STOWED
from servo_shafts import StillShaft

from uam_lab.cli import doctor as command
from uam_lab.cli.main import main
from uam_lab.flights.vehicle.lab_file import load_lab
from uam_lab.preflight.doctor import devices, installation, run
from uam_lab.preflight.doctor.check_process import TOO_LATE, CheckProcess
from uam_lab.preflight.doctor.finding import Verdict, fail, ok, warn
from uam_sim_bridge.devices.dynamixel.driver import ArmDriver
from uam_sim_bridge.devices.dynamixel.emulated import EmulatedBus, EmulatedServo
from uam_sim_bridge.devices.dynamixel.parameters import ArmDriverParameters

OK, WARN, FAIL = Verdict


def test_the_worst_verdict_counts():
    assert run.worst([]) is OK
    assert run.worst([OK, WARN, OK]) is WARN
    assert run.worst([WARN, FAIL, OK]) is FAIL


def test_a_finding_is_one_line_whatever_it_quotes():
    found = fail("x", "two\nlines", "do\n this")
    assert (found.found, found.advice) == ("two lines", "do this")


@pytest.mark.parametrize(
    ("findings", "status"),
    [([ok("a", "b")], 0), ([warn("a", "b", "c")], 0), ([ok("a", "b"), fail("a", "b", "c")], 1)],
)
def test_exit_status_text_and_json(capsys, monkeypatch, findings, status):
    examined = [("machine", finding) for finding in findings]
    monkeypatch.setattr(command, "examine", lambda *_: iter(examined))
    assert main(["doctor"]) == status
    text = capsys.readouterr().out
    assert all(f"{finding.verdict.value}" in text for finding in findings)
    assert ("→ c" in text) == (findings[-1].verdict is not OK)
    assert main(["doctor", "--json"]) == status
    document = json.loads(capsys.readouterr().out)
    assert document["verdict"] == findings[-1].verdict.value
    assert [row["check"] for row in document["findings"]] == ["a"] * len(findings)


def test_a_wrong_url_is_refused_in_one_line(capsys):
    assert main(["doctor", "--autopilot", "pigeon:coop:1"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and "unknown kind of link" in err


def test_a_check_that_breaks_is_a_finding(monkeypatch):
    monkeypatch.setattr(run, "GROUPS", ("no_such_group",))
    ((group, finding),) = run.examine()
    assert group == "no_such_group" and finding.verdict is FAIL
    assert "ModuleNotFoundError" in finding.found


def test_an_old_python_fails():
    assert installation.python((3, 10, 2)).verdict is FAIL
    assert installation.python((3, 13, 0)).verdict is OK


def test_packages_missing_or_old_are_named_with_what_to_do():
    have = metadata.version("numpy")
    found = installation.packages(
        ["numpy>=1", "no-such-package>=2", 'also-not-there; extra == "x"', "pyyaml>=999"]
    )
    assert found.verdict is FAIL
    assert "missing: no-such-package>=2" in found.found and "also-not" not in found.found
    assert "required >=999" in found.found and "numpy" not in found.found, have
    assert '"no-such-package>=2" "pyyaml>=999"' in found.advice
    assert installation.packages(["numpy>=1"]).verdict is OK
    assert installation.packages(None).verdict is WARN


def test_the_configuration_of_this_checkout_is_found():
    assert installation.config().verdict is OK


def test_a_child_that_hangs_is_ended_in_time(tmp_path):
    (tmp_path / "hangs.py").write_text(
        "import os, time\nprint('{\"pid\": %d}' % os.getpid(), flush=True)\ntime.sleep(60)\n"
    )
    path = os.pathsep.join([str(tmp_path), *sys.path])
    begun = time.monotonic()
    with CheckProcess("hangs", environment={"PYTHONPATH": path}) as child:
        message = child.wait(3.0)
    assert message.problem.startswith(TOO_LATE) and time.monotonic() - begun < 30.0
    if "pid" in message.facts:
        with pytest.raises(ProcessLookupError):
            os.kill(message.facts["pid"], 0)


def test_a_child_reports_facts_and_the_cause_of_its_failure(tmp_path):
    (tmp_path / "fails.py").write_text("print('{\"a\": 1}')\nraise SystemExit('no libEGL')\n")
    path = os.pathsep.join([str(tmp_path), *sys.path])
    with CheckProcess("fails", environment={"PYTHONPATH": path}) as child:
        message = child.wait(60.0)
    assert message.facts == {"a": 1} and message.problem == "no libEGL"


def test_an_interrupt_is_one_line(tmp_path):
    program = (
        "import time\n"
        "from uam_lab.cli import doctor, main\n"
        "def examine(url, lab):\n"
        "    print('begun', flush=True)\n"
        "    time.sleep(60)\n"
        "    yield\n"
        "doctor.examine = examine\n"
        "raise SystemExit(main.main(['doctor']))\n"
    )
    running = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert running.stdout.readline() == "begun\n"
    running.send_signal(signal.SIGINT)
    _, err = running.communicate(timeout=60.0)
    assert running.returncode == 130 and err == "uam doctor: interrupted\n"


def test_the_devices_of_a_lab_file_are_looked_for(tmp_path):
    lab = load_lab("s500_lab")
    arm = dataclasses.replace(lab.arm, device=str(tmp_path / "ttyARM"))
    line = dataclasses.replace(lab.magnet.line, chip=str(tmp_path / "chip"))
    magnet = dataclasses.replace(lab.magnet, line=line)
    lab = dataclasses.replace(lab, mocap=None, arm=arm, magnet=magnet)
    found = {one.check: one for one in devices.checks(lab)}
    assert [one.verdict for one in found.values()] == [FAIL, FAIL]
    assert (
        found["arm"].found.endswith("ttyARM: does not exist") and "uam arm" in found["arm"].advice
    )
    assert found["magnet"].found.endswith("chip: does not exist")
    (tmp_path / "chip").touch()
    servos = [EmulatedServo(i + 1, StillShaft(a), baud_rate=BAUD) for i, a in enumerate(STOWED)]
    with contextlib.closing(EmulatedBus(servos, link=tmp_path / "ttyARM")):
        other, _ = devices.checks(lab)
        driver = ArmDriver(lab.arm, ArmDriverParameters(answer_timeout=0.05))
        driver.start()  # writes the settings of a new servo
        driver.bus.close()
        found = {one.check: one for one in devices.checks(lab)}
    assert other.verdict is FAIL and "Return Delay Time" in other.found
    assert [one.verdict for one in found.values()] == [OK, OK]
    assert "2 servos on" in found["arm"].found
    assert not any(one.shaft.last.on for one in servos)
    assert (tmp_path / "chip").read_text() == ""
