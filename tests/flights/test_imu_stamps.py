"""Jitter of the IMU's stamps, repeated and missing samples: the mission as without them."""

import json

import pytest
from flight_warnings import last_values, staying, warnings
from longer import longer

from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.records.results import metrics
from uam_sim_bridge.faults import read_schedule
from uam_sim_bridge.plant import Vehicle

# scenario, jitter [s]
FLIGHTS = [
    ("quick_pick", 0.001),
    longer("pick_and_place", 0.0002),
    longer("pick_and_place", 0.001),
]
RMS = ("position_m", "attitude_deg", "arm_deg")


def fault(jitter):
    """1 % repeated and 1 % missing are the defaults of the fault."""
    return f"imu_stamps@take-off+0:jitter={jitter}"


@pytest.fixture(scope="module")
def flown():
    """direct(scenario, jitter) → (flight, metrics); 0: without the fault."""
    known = {}

    def direct(name, jitter):
        if (name, jitter) not in known:
            scenario = load_scenario(name)
            faults = read_schedule((fault(jitter),) if jitter else (), scenario, 1)
            plant = Vehicle.load()
            flight = DirectFlight(scenario, load_profile("s500"), plant, 0.2, 1, faults)
            flight.run()
            known[name, jitter] = flight, metrics.errors(flight.recording.series())
        return known[name, jitter]

    return direct


@pytest.mark.parametrize(("scenario", "jitter"), FLIGHTS)
def test_the_mission_is_flown_as_without_jitter(flown, scenario, jitter):
    flight, errors = flown(scenario, jitter)
    assert flight.mission.output.done and not flight.mission.output.abort_reason
    states = [change.target.name for change in flight.mission.changes]
    assert states == ["TAKING_OFF", "FLYING", "LANDING", "DISARMED"]
    _, nominal = flown(scenario, 0)
    for name in RMS:
        assert errors[name] == pytest.approx(nominal[name], rel=0.2)


def completed(flight):
    assert flight.wait() == 0, flight.said + flight.complained
    return json.loads((flight.out / "metrics.json").read_text())["mission_completed"]


@pytest.mark.long
def test_over_ros_no_warning_stays(fly, short_scenario):
    flight = fly("--scenario", str(short_scenario), "--seed", "3", "--fault", fault(0.001))
    assert completed(flight)
    assert int(last_values(flight.out, "state_estimator")["IMU samples missing"]) > 0
    assert warnings(flight.out) == ([], [])


@pytest.mark.slow
def test_in_real_time_no_warning_stays(fly, short_scenario):
    """Ticks that a busy machine misses are no work of the jitter; they do not count."""
    options = ("--scenario", str(short_scenario), "--seed", "3", "--clock", "realtime")
    flight = fly(*options, "--fault", fault(0.001))
    assert completed(flight)
    assert int(last_values(flight.out, "state_estimator")["IMU samples missing"]) > 0
    speed = ("ticks missed", "ticks dropped", "round trip")
    assert staying(flight.out, apart=speed) == {}
