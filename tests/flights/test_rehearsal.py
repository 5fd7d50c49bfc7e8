"""Rehearsals through the command line: the vehicle's nodes, a person, a hover.

A rehearsal is by the wall clock. On a computer that is too slow for it the start may be refused and
the flight may end otherwise, but the command must say that the computer was too slow.
"""

import json
import os
import subprocess
import sys

import psutil
import pytest
import yaml

from uam_lab.flights.processes.process_table import nodes
from uam_lab.flights.vehicle.lab_file import template
from uam_sim_bridge.px4.px4_installation import LOOP_VARIABLE, Px4Error, Px4Installation

pytestmark = pytest.mark.slow
PATIENCE = 900.0  # [s]
TOO_SLOW = 0.5  # [s] lost by the plant, from which the computer counts as too slow
SLOW = "the plant could not keep real time"
SLOW_BUS = "this computer was too slow for the servo bus"
ACTUATOR = {"through": "autopilot", "magnet": "actuator"}
GRIPPER = {"through": "autopilot", "magnet": "gripper"}
PX4 = pytest.mark.skipif(not os.environ.get(LOOP_VARIABLE), reason=f"{LOOP_VARIABLE} is not set")


def rehearse(folder, *options, px4=False, **changes):
    """Rehearse a hover; return status, output and result folder. changes: of the lab file."""
    document = yaml.safe_load(template()) | changes
    # a busy machine answers late: only a servo that is really lost is waited for
    patient = {"answer_timeout": 0.3, "watchdog": 2.5, "effort_timeout": 1.0}
    document["nodes"] = {"arm_driver": patient}
    lab = folder / "my_lab.yaml"
    lab.write_text(yaml.safe_dump(document))
    out = folder / "out"
    command = [sys.executable, "-m", "uam_lab.cli.main", "rehearse", "--config", str(lab)]
    chosen = {} if px4 else {LOOP_VARIABLE: ""}
    done = subprocess.run(
        [*command, "--out", str(out), "--no-report", *options],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        env=os.environ | {"COLUMNS": "300"} | chosen,
    )
    assert not nodes(psutil.Process().children(recursive=True)), "a node has stayed"
    assert not any((out / "devices").glob("tty*"))
    return done.returncode, done.stdout + done.stderr, out


def too_slow(said, out):
    """Whether the computer was too slow, which must then have been said."""
    lost = json.loads((out / "logs/laboratory.json").read_text())["lost_s"]
    assert lost < TOO_SLOW or SLOW in said, said
    return lost >= TOO_SLOW or SLOW_BUS in said


@pytest.mark.parametrize(
    "changes",
    [
        pytest.param({}, id="template"),
        pytest.param({"imu": "topic", "mocap": "topic"}, id="others-drivers"),
        pytest.param({"magnet": ACTUATOR}, id="actuator"),
        pytest.param({"magnet": GRIPPER}, id="gripper"),
        pytest.param({"px4": True}, id="px4", marks=PX4),
        pytest.param({"px4": True, "magnet": GRIPPER}, id="px4-gripper", marks=PX4),
    ],
)
def test_a_hover_through_all_devices(tmp_path, changes):
    if "px4" in changes and changes.get("magnet") == GRIPPER:
        try:
            Px4Installation.find(None, LOOP_VARIABLE).require_gripper()
        except Px4Error as error:
            pytest.skip(str(error))
    status, said, out = rehearse(tmp_path, **changes)
    lab = yaml.safe_load((out / "lab.yaml").read_text())
    assert lab["autopilot"].startswith("serial:")
    for device in ("motion capture", "arm", "magnet", "autopilot", "imu"):
        assert f"{device}: present" in said
    if "px4" in changes:
        assert list(out.glob("px4*.ulg")), "no log of PX4"
    if too_slow(said, out):
        return
    figures = json.loads((out / "metrics.json").read_text())
    assert status == 0, said
    assert figures["mission_completed"] and figures["clock"] == "realtime"
    devices = json.loads((out / "devices.json").read_text())
    assert devices["bus_rate_possible_hz"] > 250.0
    if lab["mocap"] != "topic":
        assert lab["mocap"]["server"] == "127.0.0.1" and devices["mocap_latency_ms"] >= 11.0
    steps = json.loads((out / "logs/laboratory.json").read_text())["steps"]
    assert {"hands_on", "clear"} <= set(steps)


def test_a_reversed_joint_is_found_before_arming(tmp_path):
    status, said, out = rehearse(tmp_path, "--cable", "direction_reversed@start:joint=1")
    assert status == 1 and "start refused" in said
    assert json.loads((out / "logs/laboratory.json").read_text())["armed"] is False


def test_a_box_is_carried_by_the_grippers_servo_on_the_bus(tmp_path):
    arm = yaml.safe_load(template())["arm"]
    arm["gripper"] = {"id": 3, "model": "xm430_w350", "direction": 1, "zero": 1200}
    mocap = yaml.safe_load(template())["mocap"] | {"payload": "box"}
    changes = {"vehicle": "s500_gripper", "scenario": "two_finger", "magnet": {"through": "servo"}}
    changes["layout"] = "fused"  # two cores do not keep three servos at 250 Hz beside all nodes
    status, said, out = rehearse(tmp_path, arm=arm, mocap=mocap, **changes)
    if too_slow(said, out):
        return
    figures = json.loads((out / "metrics.json").read_text())
    assert status == 0 and figures["grasp"]["state"] == "released", said
    assert "fingers 40 mm open" in figures["grasp"]["decisions"][1]["text"]
    assert figures["payload_place_error_m"] <= 0.03
