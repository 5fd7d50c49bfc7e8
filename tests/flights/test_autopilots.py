"""Autopilots that the user has started: by UDP, and over a serial line (HITL)."""

import json
import subprocess
import sys

import pytest
from serial_line import SerialLine

from uam_lab.cli.main import main
from uam_sim_bridge.ports import AUTOPILOT_UDP, Reservation

AUTOPILOT = [sys.executable, "-m", "uam_sim_bridge.autopilot.server", "--once"]


@pytest.fixture
def started():
    """started(*arguments): the stand-in as a program of the user's; ended after the test."""
    running = []

    def start(*arguments):
        running.append(subprocess.Popen([*AUTOPILOT, *arguments]))
        return running[-1]

    yield start
    for process in running:
        process.terminate()
        process.wait(20)


@pytest.mark.slow
def test_an_autopilot_that_the_user_has_started_flies_by_its_udp_link(fly, short_scenario, started):
    with Reservation() as free:
        instance = free.ports.instance
    autopilot = started("--instance", str(instance), "--wait", "120")
    url = f"udp:127.0.0.1:{AUTOPILOT_UDP + instance}"
    flight = fly("--scenario", str(short_scenario), "--autopilot", url)
    assert flight.wait() == 0, flight.said + flight.complained
    found = json.loads((flight.out / "metrics.json").read_text())
    assert found["mission_completed"] and found["autopilot"] == url
    assert autopilot.wait(20) == 0  # the plant hung up


@pytest.mark.slow
def test_a_flight_controller_on_a_serial_line_flies_the_simulated_vehicle(
    fly, short_scenario, started, tmp_path
):
    patient = tmp_path / "patient.yaml"  # the stand-in's clock is the simulation's
    patient.write_text("mission:\n  ros__parameters:\n    slower_hold: 1.0\n")
    line = SerialLine()
    try:
        started("--serial", f"{line.far}:921600")
        flight = fly(
            "--scenario",
            str(short_scenario),
            *("--profile", "s500", "--profile", str(patient)),
            "--clock",
            "realtime",
            "--autopilot",
            f"serial:{line.near}:921600",
            "--arm",
        )
        assert flight.wait() in (0, 1), flight.said + flight.complained
        found = json.loads((flight.out / "metrics.json").read_text())
        # how well it flies in real time depends on the machine; that it armed and took off does not
        assert found["duration_s"] > 0.0, found
        assert found["autopilot"].startswith("serial:") and found["clock"] == "realtime"
        assert "HIL_SENSOR at 250 Hz" in (flight.out / "logs" / "autopilot.log").read_text()
    finally:
        line.close()


@pytest.mark.parametrize(
    "options, said",
    [
        (["--autopilot", "ardupilot"], "builtin, px4, or a link"),
        (["--autopilot", "udp:127.0.0.1:0"], "port 0 is not in 1..65535"),
        (["--autopilot", "serial:/dev/null:921600"], "needs --clock realtime"),
        (["--autopilot", "udp:127.0.0.1:14580", "--engine", "direct"], "needs --engine ros"),
        (["--gcs", "tcp:127.0.0.1:14550"], "--gcs must be udp:HOST:PORT"),
    ],
)
def test_a_wrong_autopilot_is_refused_in_one_line(options, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["fly", *options]) == 2
    complained = capsys.readouterr().err
    assert said in complained and complained.count("\n") == 1
    assert not any(tmp_path.iterdir())
