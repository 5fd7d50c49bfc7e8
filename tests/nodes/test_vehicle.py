"""`uam vehicle`: all hardware absent, then emulated devices one by one, then Ctrl-C."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest
import yaml
from arm_rig import BAUD, STOWED
from autopilot_on_a_line import AutopilotOnALine
from mocap_room import MocapRoom
from servo_shafts import StillShaft
from tracked_vehicle import TrackedBody

from uam_lab.flights.processes.process_table import nodes
from uam_lab.flights.vehicle.lab_file import template
from uam_sim_bridge.devices.dynamixel.emulated import EmulatedBus, EmulatedServo
from uam_sim_bridge.devices.mocap.emulated.mocap_server import MocapServer, Streaming

PATIENCE = 120.0  # [s]
PLACE = np.array([0.0, 0.0, 0.2])
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


class Bringup:
    """The command in a process of its own, with the lines that it has printed."""

    def __init__(self, lab, out):
        self.lines = out.parent / "printed.txt"
        command = [sys.executable, "-m", "uam_lab.cli.main", "vehicle", "--config", str(lab)]
        with self.lines.open("w") as file:
            self.process = subprocess.Popen(
                [*command, "--out", str(out), "--no-report"],
                stdout=file,
                stderr=subprocess.STDOUT,
                env=os.environ | {"COLUMNS": "300"},
            )

    @property
    def printed(self):
        return self.lines.read_text()

    def until(self, *texts):
        """Wait until a line contains all `texts`."""
        deadline = time.monotonic() + PATIENCE
        while not any(all(t in line for t in texts) for line in self.printed.splitlines()):
            assert self.process.poll() is None, self.printed
            assert time.monotonic() < deadline, f"not printed: {texts}\n{self.printed}"
            time.sleep(0.1)

    def kill(self, name):
        children = nodes(psutil.Process(self.process.pid).children(recursive=True))
        (found,) = [process for process, node in children.items() if node == name]
        found.kill()

    def until_logged(self, out, node, text, times):
        """Wait until the output of a node contains `text` so many times."""
        log, deadline = out / f"logs/{node}.log", time.monotonic() + PATIENCE
        while log.read_text().count(text) < times:
            assert time.monotonic() < deadline, log.read_text()
            time.sleep(0.1)

    def interrupt(self):
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(PATIENCE)


@pytest.fixture
def laboratory(tmp_path):
    """A lab file of devices that are all absent, and where they would be."""
    document = yaml.safe_load(template())
    with MocapServer([TrackedBody("uam")]) as unused:
        port = unused.port
    document["mocap"] |= {"server": "127.0.0.1", "command_port": port}
    document["autopilot"] = f"serial:{tmp_path / 'ttyPX4'}:921600"
    document["arm"]["device"] = str(tmp_path / "ttyARM")
    document["magnet"]["chip"] = f"simulated:{tmp_path / 'gpio/line'}"
    # a busy machine answers late: only a servo that is really lost is waited for
    patient = {"answer_timeout": 0.3, "watchdog": 2.5, "effort_timeout": 1.0}
    document["nodes"] = {"arm_driver": patient}
    lab = tmp_path / "my_lab.yaml"
    lab.write_text(yaml.safe_dump(document))
    return lab, port


def test_each_missing_device_is_named_and_used_once_it_is_there(laboratory, tmp_path):
    lab, port = laboratory
    out = tmp_path / "flight"
    run = Bringup(lab, out)
    opened = contextlib.ExitStack()
    try:
        run.until("motion capture: missing: no answer of", str(port), "check: ping 127.0.0.1")
        run.until("arm: missing:", "ttyARM: does not exist", f"uam arm --config {lab}")
        run.until("magnet: missing:", "No such file", "gpiodetect")
        run.until("autopilot: missing:", "ttyPX4", "cannot be opened", "uam doctor --autopilot")
        run.until("imu: missing: no message on /imu/data", "autopilot's link")
        run.until("all nodes are connected")
        assert "Traceback" not in run.printed and "present" not in run.printed

        (tmp_path / "gpio").mkdir()
        run.until("magnet: present")
        assert (tmp_path / "gpio/line").read_text() == "0"
        shafts = [StillShaft(angle) for angle in STOWED]
        servos = [EmulatedServo(i + 1, one, baud_rate=BAUD) for i, one in enumerate(shafts)]
        opened.enter_context(contextlib.closing(EmulatedBus(servos, link=tmp_path / "ttyARM")))
        run.until("arm: present")
        server = MocapRoom(
            [TrackedBody("uam")], lambda _: {"uam": (PLACE, LEVEL)}, Streaming(port=port)
        )
        opened.enter_context(server)
        run.until("motion capture: present")
        autopilot = AutopilotOnALine(tmp_path / "ttyPX4")
        opened.callback(autopilot.close)
        run.until("autopilot: present")
        run.until("imu: present")
        # every input is there: the estimate begins, and the mission waits on the ground
        run.until("before take-off", "waiting")
        run.kill("arm_driver")
        run.until("arm_driver was killed by SIGKILL; restarted")
        run.until_logged(out, "arm_driver", "2 servos on", 2)
        autopilot.close()
        run.until("imu: missing: no message on /imu/data for")
        assert run.interrupt() == 130, run.printed
    finally:
        run.process.kill()
        opened.close()
    assert "Traceback" not in run.printed
    assert not nodes(psutil.Process().children(recursive=True)), "a node has stayed"
    assert shafts[0].last.on is False and (tmp_path / "gpio/line").read_text() == "0"
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["errors_of"] == "estimate" and metrics["clock"] == "realtime"
    assert "errors are estimate − reference" in run.printed
    assert {file.name for file in out.iterdir()} >= {
        *("lab.yaml", "log.mcap", "timeseries.parquet", "info.json", "parameters.yaml"),
    }
    logs = "".join(file.read_text() for file in (out / "logs").glob("*.log"))
    assert "Traceback" not in logs
