"""A pilot takes over from a real PX4's OFFBOARD; PX4's own battery failsafe does, too."""

import json
import subprocess
import sys

import pytest
from px4_at_hand import NO_PX4, installation
from px4_pilot import Pilot
from whole_flight import ROOT, Flight

from uam_sim_bridge.mavlink.protocol.modes import Mode

INSTANCE = 31
PHASES = "take-off", "approach", "pick", "carry", "land"
# [s] until the command; at home RETURN lands
HELD = {Mode.HOLD: 4.0, Mode.POSITION: 4.0, Mode.RETURN: 1.2}

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(installation() is None, reason=NO_PX4),
]


@pytest.fixture
def take_over(tmp_path):
    """Start quick_pick with a pilot who acts; both end with the test."""
    started = []

    def start(phase, mode):
        options = "--autopilot", "px4", "--scenario", "quick_pick", "--instance", str(INSTANCE)
        flight = Flight(tmp_path / "flight", *options)
        pilot = Pilot(INSTANCE + 1, mode)
        started.append((flight, pilot))
        flight.until_phase(phase)
        pilot.act(after=1.0)
        flight.until_phase("released")
        return flight, pilot

    yield start
    for flight, pilot in started:
        flight.end()
        pilot.close()


def resume():
    """Give the command as a user does; return its exit status and words."""
    command = [sys.executable, "-m", "uam_lab.cli.main", "resume", "--instance", str(INSTANCE)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("mode", HELD, ids=lambda mode: mode.name)
def test_a_mode_of_the_pilot_stays_until_the_command(take_over, mode, phase):
    flight, pilot = take_over(phase, mode)
    held = HELD[mode]
    flight.until(lambda: pilot.acted and pilot.since > pilot.acted + held, f"{mode.name} is held")
    assert pilot.since_acted == [mode], "not before the command"
    status, said = resume()
    if mode is not Mode.RETURN:  # near home RETURN lands, and may be down before the command
        assert status == 0, said
    flight.wait()
    metrics = json.loads((flight.out / "metrics.json").read_text())
    assert metrics["abort_reason"] is None or mode is Mode.RETURN, flight.said


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("mode", [Mode.LAND, None], ids=["LAND", "battery"])
def test_a_landing_by_pilot_or_battery_is_not_overridden(take_over, mode, phase):
    flight, pilot = take_over(phase, mode)
    assert flight.wait() != 0, "the mission is not completed"
    # PX4 shows OFFBOARD again once it has disarmed
    flown = [found for found in pilot.since_acted if found is not Mode.OFFBOARD]
    assert flown[:1] == [Mode.LAND]
    metrics = json.loads((flight.out / "metrics.json").read_text())
    assert "has control" in metrics["abort_reason"]
