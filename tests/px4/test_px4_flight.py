"""A real PX4 flies the mission. Skipped, saying so, where none is pointed at (PX4_SITL_DIR)."""

import json
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
from px4_at_hand import NO_PX4, installation
from rate_steps import LIMIT, compared, measure
from whole_flight import Flight

from uam_sim_bridge.mavlink.telemetry.required_parameters import RequiredParameters

PLACED = 0.25  # [m]
TIMES_THE_STAND_INS = 2.0
# PX4 takes roll and pitch from its IMU, the stand-in from vision. Seed 1 has an accelerometer bias
# of (0.11, -0.27) m/s^2, so PX4's level is off by up to atan(0.27 / 9.81) = 1.6 deg. The vehicle
# moves by 6 cm until the integral of the position law has learnt it, within 4 s of 88: less than
# 0.06 m * sqrt(2 / 88) = 9 mm RMS, and the hand with it.
LEVEL_OFF = {
    "position_m": (0.01, 0.01, 0.0),
    "attitude_deg": (1.8, 1.8, 0.0),
    "end_effector_m": (0.01, 0.01, 0.0),
}
PATIENCE = 900.0  # [s]
TMP = Path(tempfile.gettempdir())


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


def assert_flown_alike(found, ours, **beyond):
    """Twice the RMS of the stand-in's flight at most, plus `beyond` by group."""
    for group, rms in ours["rms"].items():
        limit = TIMES_THE_STAND_INS * np.array(rms) + beyond.get(group, 0.0)
        assert np.all(np.array(found["rms"][group]) <= limit), (group, found["rms"][group], rms)


def test_px4_flies_the_mission_about_as_well_as_the_stand_in(fly):
    px4 = fly("px4", "--autopilot", "px4")
    found = metrics(px4)
    assert found["autopilot"] == "px4" and found["mission_completed"] and found["payload_lifted"]
    assert found["payload_place_error_m"] < PLACED
    assert (px4.out / "px4.ulg").read_bytes().startswith(b"ULog")
    assert_flown_alike(found, metrics(fly("stand-in")))


def test_px4_flies_the_mission_with_attitude_setpoints(fly):
    profiles = ("--profile", "s500", "--profile", "attitude_setpoints")
    found = metrics(fly("attitude", "--autopilot", "px4", *profiles))
    assert found["mission_completed"] and found["payload_place_error_m"] < PLACED
    assert_flown_alike(found, metrics(fly("stand-in", *profiles)), **LEVEL_OFF)


def test_px4_flies_a_hexacopter_as_the_stand_in_does(fly):
    options = ("--vehicle", "hexa_arm", "--scenario", "circle")
    found, ours = metrics(fly("px4", "--autopilot", "px4", *options)), metrics(fly("own", *options))
    assert found["mission_completed"]
    assert_flown_alike(found, ours)


def test_two_flights_with_px4_at_once(fly):
    both = [fly(name, "--autopilot", "px4", "--scenario", "hover") for name in ("one", "other")]
    for flight in both:
        assert metrics(flight)["mission_completed"]
    assert both[0].instance != both[1].instance


def test_the_stand_in_answers_body_rate_steps_as_px4_does():
    found = compared(measure(None), measure(installation()))
    for axis, row in found.items():
        assert row["distance"] <= LIMIT, (axis, row)


def left_in_temporary_folder():
    """Return what flights with PX4 leave there if they do not clean up."""
    return {str(file) for pattern in ("uam-px4-*", "px4_lock-*") for file in TMP.glob(pattern)}


def test_parameters_are_read_back_equal_to_the_configuration(fly):
    flight = fly("px4", "--autopilot", "px4", "--scenario", "hover", "--px4-param", "SDLOG_MODE=0")
    assert metrics(flight)["mission_completed"]
    logs = flight.out / "logs"
    rules = RequiredParameters.read(str(logs / "px4_parameters.yaml"))
    assert rules["COM_LOW_BAT_ACT"].met(0) and rules["SENS_IMU_MODE"].met(1)
    assert rules["SDLOG_MODE"].met(0) and not rules["SDLOG_MODE"].met(1)
    said = (logs / "mavlink_bridge.log").read_text()
    (read,) = re.findall(r"(\d+) of (\d+) parameters read$", said, re.M)
    optional = sum(rule.optional for rule in rules.values())
    assert int(read[1]) == len(rules) and int(read[0]) >= len(rules) - optional
    assert " required: " not in said and "set to" not in said
    # a normal start and landing
    for alarm in ("Heading estimate", "denied", "refused", "WARN"):
        assert alarm not in said, said


def test_a_bad_parameter_is_refused_before_the_flight(fly):
    for parameter, complaint in (
        ("COM_OF_LOST_T=1", "none of this name"),
        ("COM_OF_LOSS_T=61", "allowed: 0 to 60"),
    ):
        flight = fly(parameter, "--autopilot", "px4", "--px4-param", parameter)
        assert flight.wait(PATIENCE) == 2 and complaint in flight.complained


def test_a_killed_px4_leaves_its_log_and_nothing_else(fly):
    before = left_in_temporary_folder()
    flight = fly(
        *("killed", "--autopilot", "px4", "--scenario", "hover"),
        *("--fault", "node_kill@4:node=autopilot"),
    )
    assert flight.wait(PATIENCE) == 1
    assert "PX4 was ended by SIGKILL" in (flight.out / "logs" / "autopilot.log").read_text()
    assert "autopilot" in flight.complained
    assert (flight.out / "px4.ulg").read_bytes().startswith(b"ULog")
    assert left_in_temporary_folder() <= before
