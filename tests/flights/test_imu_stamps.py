"""Jitter of the IMU's stamps, repeated and missing samples: the mission as without them."""

import json

import pytest
from rosbags.highlevel import AnyReader

from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.flight.direct.flight import DirectFlight
from uam_lab.results import metrics
from uam_sim_bridge.faults import read_schedule
from uam_sim_bridge.plant import Vehicle

JITTERS = (0.0002, 0.001)  # [s]
RMS = ("position_m", "attitude_deg", "arm_deg")


def fault(jitter):
    """1 % repeated and 1 % missing are the defaults of the fault."""
    return f"imu_stamps@take-off+0:jitter={jitter}"


@pytest.fixture(scope="module")
def flown():
    """direct(jitter) → (flight, metrics); 0: without the fault."""
    known = {}

    def direct(jitter):
        if jitter not in known:
            scenario = load_scenario("pick_and_place")
            faults = read_schedule((fault(jitter),) if jitter else (), scenario, 1)
            plant = Vehicle.load()
            flight = DirectFlight(scenario, load_profile("s500"), plant, 0.2, 1, faults)
            flight.run()
            known[jitter] = flight, metrics.errors(flight.recording.series())
        return known[jitter]

    return direct


@pytest.mark.parametrize("jitter", JITTERS)
def test_the_mission_is_flown_as_without_jitter(flown, jitter):
    flight, errors = flown(jitter)
    assert flight.mission.output.done and not flight.mission.output.abort_reason
    states = [change.target.name for change in flight.mission.changes]
    assert states == ["TAKING_OFF", "FLYING", "LANDING", "DISARMED"]
    _, nominal = flown(0)
    for name in RMS:
        assert errors[name] == pytest.approx(nominal[name], rel=0.2)


def test_over_ros_no_warning_stays(fly, short_scenario):
    flight = fly("--scenario", str(short_scenario), "--seed", "3", "--fault", fault(0.001))
    assert flight.wait() == 0, flight.said + flight.complained
    assert json.loads((flight.out / "metrics.json").read_text())["mission_completed"]
    warned, missing = [], 0
    with AnyReader([flight.out]) as reader:
        chosen = [c for c in reader.connections if c.topic in ("/diagnostics", "/rosout")]
        for connection, time, data in reader.messages(chosen):
            message = reader.deserialize(data, connection.msgtype)
            if connection.topic == "/rosout":
                warned += [(time, message.name, message.msg)] if message.level >= 30 else []
                continue
            for status in message.status:
                values = {pair.key: pair.value for pair in status.values}
                if status.name == "state_estimator":
                    missing = int(values["IMU samples missing"])
                # on the ground the autopilot refuses to disarm until it has detected the landing
                if status.level in (1, 2) and "disarming" not in status.message:
                    warned.append((time, status.name, status.message))
    assert missing > 0
    assert warned == []
