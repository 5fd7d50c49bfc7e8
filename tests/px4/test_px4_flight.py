"""A real PX4 flies the mission. Skipped, saying so, where none is pointed at (PX4_SITL_DIR)."""

import json

import numpy as np
import pytest
from px4_at_hand import NO_PX4, installation
from rate_steps import LIMIT, compared, measure
from whole_flight import Flight

PLACED = 0.25  # [m]
TIMES_THE_STAND_INS = 2.0
PATIENCE = 900.0  # [s]


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(installation() is None, reason=NO_PX4),
]


@pytest.fixture
def fly(tmp_path):
    flights = []

    def start(name, *options):
        flights.append(Flight(tmp_path / name, *options))
        return flights[-1]

    yield start
    for flight in flights:
        flight.end()


def metrics(flight):
    assert flight.wait(PATIENCE) == 0, flight.said + flight.complained
    return json.loads((flight.out / "metrics.json").read_text())


def test_px4_flies_the_mission_about_as_well_as_the_stand_in(fly):
    px4 = fly("px4", "--autopilot", "px4")
    found = metrics(px4)
    assert found["autopilot"] == "px4" and found["mission_completed"] and found["payload_lifted"]
    assert found["payload_place_error_m"] < PLACED
    assert (px4.out / "px4.ulg").read_bytes().startswith(b"ULog")
    ours = metrics(fly("stand-in"))
    for group, rms in ours["rms"].items():
        limit = TIMES_THE_STAND_INS * np.array(rms)
        assert np.all(np.array(found["rms"][group]) <= limit), (group, found["rms"][group], rms)


def test_px4_flies_the_mission_with_attitude_setpoints(fly):
    profiles = ("--profile", "s500", "--profile", "attitude_setpoints")
    found = metrics(fly("attitude", "--autopilot", "px4", *profiles))
    assert found["mission_completed"] and found["payload_place_error_m"] < PLACED
    ours = metrics(fly("stand-in", *profiles))
    for group, rms in ours["rms"].items():
        assert np.all(np.array(found["rms"][group]) <= TIMES_THE_STAND_INS * np.array(rms)), group


def test_two_flights_with_px4_at_once(fly):
    both = [fly(name, "--autopilot", "px4", "--scenario", "hover") for name in ("one", "other")]
    for flight in both:
        assert metrics(flight)["mission_completed"]
    assert both[0].instance != both[1].instance


def test_the_stand_in_answers_body_rate_steps_as_px4_does():
    found = compared(measure(None), measure(installation()))
    for axis, row in found.items():
        assert row["distance"] <= LIMIT, (axis, row)
