"""The estimator runs from the autopilot's IMU: direct with jitter of its stamps, over MAVLink."""

import json

import numpy as np
import pytest
from flight_warnings import stamps, staying

from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.records.results import metrics
from uam_sim_bridge.plant import Vehicle

RMS = ("position_m", "attitude_deg", "arm_deg")
PERIOD = 0.004  # [s]
JITTER = 0.001  # [s] as TIMESYNC over a slow link


class Jittered:
    """The samples of an autopilot's IMU with jitter of the stamps, 1 % repeated and 1 % missing."""

    def __init__(self, imu):
        self._imu, self._random, self._last = imu, np.random.default_rng(5), None

    def __call__(self):
        late, repeated, missing = self._random.random(3)
        sample = self._imu()
        if sample is None or missing < 0.01:
            return None
        if repeated < 0.01 and self._last is not None:
            return self._last
        time, gyro, force = sample
        self._last = time + JITTER * (2.0 * late - 1.0), gyro, force
        return self._last


def flown(name, autopilot_imu, jittered=False):
    scenario = load_scenario(name)
    flight = DirectFlight(
        scenario, load_profile("s500"), Vehicle.load(), 0.2, 1, autopilot_imu=autopilot_imu
    )
    if jittered:
        flight.autopilot.imu = Jittered(flight.autopilot.imu)
    flight.run()
    return flight, metrics.errors(flight.recording.series())


@pytest.mark.parametrize(
    "name", ["quick_pick", pytest.param("pick_and_place", marks=pytest.mark.long)]
)
def test_the_mission_is_completed_with_jitter_as_with_the_companions_imu(name):
    _, nominal = flown(name, autopilot_imu=False)
    flight, errors = flown(name, autopilot_imu=True, jittered=True)
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
