"""The estimator runs from the autopilot's IMU: direct with jitter of its stamps, over MAVLink."""

import json

import numpy as np
import pytest
from flight_warnings import stamps, staying
from longer import longer

from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.records.results import metrics
from uam_sim_bridge.plant import Vehicle

RMS = ("position_m", "attitude_deg", "arm_deg")
PERIOD = 0.004  # [s]
JITTER = 1_000_000  # [ns] as TIMESYNC over a slow link


def jittered():
    """A stage: jitter of the stamps of the IMU's samples, 1 % repeated and 1 % missing."""
    random, last = np.random.default_rng(5), None

    def stage(control):
        nonlocal last
        late, repeated, missing = random.random(3)
        signals = control.signals
        if signals.imu is None or missing < 0.01:
            signals.imu = None
            return True
        if repeated >= 0.01 or last is None:
            stamp, gyro, force = signals.imu
            last = stamp + round(JITTER * (2.0 * late - 1.0)), gyro, force
        signals.imu = last
        return True

    return stage


def flown(name, autopilot_imu):
    scenario = load_scenario(name)
    flight = DirectFlight(
        scenario, load_profile("s500"), Vehicle.load(), 0.2, 1, autopilot_imu=autopilot_imu
    )
    if autopilot_imu:
        flight.control.insert("estimator", "jitter", jittered())
    flight.run()
    return flight, metrics.errors(flight.recording.series())


@pytest.mark.parametrize("name", [longer(one) for one in ("quick_pick", "pick_and_place")])
def test_the_mission_is_completed_with_jitter_as_with_the_companions_imu(name):
    _, nominal = flown(name, autopilot_imu=False)
    flight, errors = flown(name, autopilot_imu=True)
    assert flight.mission.output.done and not flight.mission.output.abort_reason
    ticks = flight.control.estimator.ticks
    assert min(ticks.missing, ticks.repeated) > 25  # of some 60 each in the short mission
    for name in RMS:
        assert errors[name] == pytest.approx(nominal[name], rel=0.2)


@pytest.mark.slow
def test_over_mavlink_no_other_imu_is_needed(fly, short_scenario):
    flight = fly("--scenario", str(short_scenario), "--seed", "3", "--imu", "autopilot")
    assert flight.wait() == 0, flight.said + flight.complained
    assert json.loads((flight.out / "metrics.json").read_text())["mission_completed"]
    sent, ticks = (np.unique(stamps(flight.out, topic)) for topic in ("/imu/data", "/uam/state"))
    assert len(sent) > 1500 and sent[-1] - ticks[-1] < PERIOD
    begun = ticks > ticks[0] + 0.5  # while the nodes start, ticks may be dropped
    assert np.diff(ticks[begun]).max() < 1.5 * PERIOD
    assert staying(flight.out) == {}
