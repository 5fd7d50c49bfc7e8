"""A rehearsal through the command line: the vehicle's nodes, a person, a hover."""

import json
import os
import subprocess
import sys

import pytest
import yaml

from uam_lab.processes.process_table import nodes
from uam_lab.vehicle.lab_file import template

pytestmark = pytest.mark.slow
PATIENCE = 900.0  # [s]


def rehearse(folder, *options):
    """Rehearse a hover; return status, output and result folder."""
    document = yaml.safe_load(template())
    # a busy machine answers late: only a servo that is really lost is waited for
    patient = {"answer_timeout": 0.3, "watchdog": 2.5, "effort_timeout": 1.0}
    document["nodes"] = {"arm_driver": patient}
    lab = folder / "my_lab.yaml"
    lab.write_text(yaml.safe_dump(document))
    out = folder / "out"
    command = [sys.executable, "-m", "uam_lab.cli.main", "rehearse", "--config", str(lab)]
    done = subprocess.run(
        [*command, "--out", str(out), "--no-report", *options],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        env=os.environ | {"COLUMNS": "300"},
    )
    assert not nodes()
    return done.returncode, done.stdout + done.stderr, out


def test_a_hover_through_all_devices(tmp_path):
    status, said, out = rehearse(tmp_path)
    figures = json.loads((out / "metrics.json").read_text())
    assert status == 0, said
    assert figures["mission_completed"] and figures["clock"] == "realtime"
    devices = json.loads((out / "devices.json").read_text())
    assert devices["bus_rate_possible_hz"] > 250.0 and devices["mocap_latency_ms"] >= 11.0
    lab = yaml.safe_load((out / "lab.yaml").read_text())
    assert lab["autopilot"].startswith("serial:") and lab["mocap"]["server"] == "127.0.0.1"
    steps = json.loads((out / "logs/laboratory.json").read_text())["steps"]
    assert {"hands_on", "clear"} <= set(steps)
    assert not any((out / "devices").glob("tty*"))


def test_a_reversed_joint_is_found_before_arming(tmp_path):
    status, said, out = rehearse(tmp_path, "--cable", "direction_reversed@start:joint=1")
    assert status == 1 and "start refused" in said
    assert json.loads((out / "logs/laboratory.json").read_text())["armed"] is False
