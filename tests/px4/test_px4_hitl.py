"""PX4 with its own clock flies the simulated vehicle over a serial line.

Skipped, saying so, where no build without lockstep is pointed at (PX4_HITL_DIR).
"""

import json

import numpy as np
import pytest
from px4_in_the_loop import BAUD, NO_PX4, FlightController, installation
from serial_line import SerialLine
from whole_flight import Flight

PLACED = 0.25  # [m]
LARGEST_TILT = 15.0  # [deg]
PATIENCE = 900.0  # [s]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(installation() is None, reason=NO_PX4),
]


@pytest.fixture
def line(tmp_path):
    """A line with a PX4 at its far end."""
    made = SerialLine()
    controller = FlightController(installation(), tmp_path / "px4", made.far)
    yield made
    controller.end()
    made.close()


@pytest.mark.parametrize("scenario", ["hover", "quick_pick"])
def test_a_flight_in_the_loop_completes_or_says_that_the_computer_is_too_slow(
    line, tmp_path, scenario
):
    flight = Flight(
        tmp_path / scenario,
        *("--autopilot", f"serial:{line.near}:{BAUD}", "--clock", "realtime", "--arm"),
        *("--scenario", scenario),
    )
    status = flight.wait(PATIENCE)
    said = (flight.out / "logs" / "mavlink_bridge.log").read_text()
    assert "the autopilot rebooted" not in said, said
    assert " required: " not in said, said  # the parameters are those of the flight
    if status != 0:
        mission = (flight.out / "logs" / "mission.log").read_text()
        assert "slower than the wall clock" in mission + flight.complained, mission
        return
    found = json.loads((flight.out / "metrics.json").read_text())
    assert found["mission_completed"]
    assert np.max(found["max"]["attitude_deg"]) < LARGEST_TILT
    if scenario == "quick_pick":
        assert found["payload_lifted"] and found["payload_place_error_m"] < PLACED
