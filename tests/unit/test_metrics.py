"""metrics.json on tables small enough to work out by hand."""

import json
import math

import numpy as np
import pytest
from default_columns import COLUMNS

from uam_lab.records.results import metrics
from uam_lab.records.results.timeseries import FlightTable

INFO = {
    "controller": "modular",
    "vehicle": "s500_arm",
    "profile": "s500",
    "scenario": "pick_and_place",
    "engine": "direct",
    "layout": None,
    "clock": "lockstep",
    "autopilot": "builtin",
    "seed": 3,
    "payload_mass_kg": 0.2,
    "wall_s": 2.0,
    "abort_reason": "",
    "drop_point": [0.8, 0.0],
}


def flight(phases=None, payload=True):
    """Ten ticks of 0.5 s from -1 s: two waiting, six in flight, two landed at (0.03, 0.04).

    The payload is raised by 0.3 m while the magnet is on and ends 0.05 m from (0.8, 0).
    """
    made = FlightTable(10, COLUMNS)
    for k in range(10):
        name = "waiting" if k < 2 else "hover" if k < 8 else "landed"
        row = made.next_row(phases[k] if phases else name)
        row[:] = 0.0
        row[COLUMNS["time"]] = -1.0 + 0.5 * k
    values = made.values
    values[8:, COLUMNS["truth.x"]] = 0.03
    values[8:, COLUMNS["truth.y"]] = 0.04
    if payload:
        values[:, COLUMNS["payload.z"]] = 0.7
        values[3:6, COLUMNS["magnet.on"]] = 1.0
        values[4:6, COLUMNS["payload.z"]] = 1.0
        values[6:, COLUMNS["payload.z"]] = 0.02
        values[6:, COLUMNS["payload.x"]] = 0.84
        values[6:, COLUMNS["payload.y"]] = -0.03
    return made


def test_a_vehicle_that_stays_on_the_ground_has_not_completed_its_mission():
    made = flight()
    made.values[2:8, COLUMNS["reference.z"]] = [0.0, 0.5, 1.0, 1.0, 0.5, 0.0]
    made.values[2:8, COLUMNS["truth.z"]] = [0.0, 0.01, 0.02, 0.01, 0.0, 0.0]
    assert metrics.compute(made.series(), INFO)["shortfalls"] == ["never took off"]
    made.values[4, COLUMNS["truth.z"]] = 0.9
    assert metrics.compute(made.series(), INFO)["mission_completed"]
    made.values[:, COLUMNS["truth.z"]] = np.nan  # a real vehicle
    assert "never took off" not in metrics.compute(made.series(), INFO)["shortfalls"]


@pytest.mark.parametrize(
    ("grasp", "mass", "missing"),
    [("absent", 0.2, True), ("given up", 0.2, True), ("absent", 0.0, False), ("lost", 0.2, False)],
)
def test_a_payload_that_was_left_where_it_is_is_missing(grasp, mass, missing):
    made = flight()
    made.values[:, COLUMNS["magnet.on"]] = 0.0
    told = [{"time_s": 1.0, "grasp": grasp, "attempt": 1, "text": "it is elsewhere"}]
    result = metrics.compute(made.series(), INFO | {"grasps": told, "payload_mass_kg": mass})
    assert result["shortfalls"] == (["payload it is elsewhere"] if missing else [])
    assert result["mission_completed"] is not missing


def test_rms_and_maximum_run_over_the_flight_only():
    made = flight()
    made.values[:, COLUMNS["truth.y"]] = 0.0
    made.values[2:8, COLUMNS["truth.x"]] = [3, -4, 0, 0, 0, 0]
    made.values[2:8, COLUMNS["reference.pitch"]] = math.radians(2.0)
    made.values[0, COLUMNS["truth.z"]] = 100.0  # before take-off: does not count
    made.values[9, COLUMNS["reference.alpha_1"]] = 1.0  # after touchdown: does not count
    result = metrics.compute(made.series(), INFO)
    assert result["rms"]["position_m"] == pytest.approx([math.sqrt(25 / 6), 0.0, 0.0])
    assert result["max"]["position_m"] == pytest.approx([4.0, 0.0, 0.0])
    assert result["rms"]["attitude_deg"] == pytest.approx([0.0, 2.0, 0.0])
    assert result["max"]["attitude_deg"] == pytest.approx([0.0, 2.0, 0.0])
    assert result["rms"]["arm_deg"] == [0.0, 0.0]
    assert result["duration_s"] == 2.5
    assert result["real_time_factor"] == 4.5 / 2.0


def test_errors_by_phase_and_of_the_trajectory_alone():
    made = flight([*["waiting"] * 2, "take-off", *["trajectory"] * 3, "hold", "trajectory",
                   *["landed"] * 2])  # fmt: skip
    made.values[:, COLUMNS["truth.y"]] = 0.0
    made.values[2:8, COLUMNS["truth.x"]] = [9, 0, 0, 2, 9, 0]
    made.values[2:8, COLUMNS["truth.z"]] = [0, 0, 0, 1, 0, 2]
    made.values[7, COLUMNS["truth.roll"]] = math.radians(60.0)
    for i in range(1, 5):
        made.values[4, COLUMNS[f"rotor_{i}.thrust"]] = i
    result = metrics.compute(made.series(), INFO)
    assert [one["phase"] for one in result["phases"]] == ["take-off", "trajectory", "hold"]
    whole = result["trajectory"]
    assert whole == result["phases"][1]
    # distances in the trajectory: 0, 0, sqrt(5), 2
    assert whole["position_3d_m"] == pytest.approx(1.5)
    assert whole["largest_3d_m"] == pytest.approx(math.sqrt(5.0))
    assert whole["rms"]["position_m"] == pytest.approx([1.0, 0.0, math.sqrt(5 / 4)])
    assert (whole["from_s"], whole["seconds"]) == (0.5, 2.0)
    assert whole["tilt_deg"] == pytest.approx(60.0) and whole["thrust_n"] == 10.0
    assert result["position_3d_m"] == pytest.approx(math.sqrt((81 + 5 + 81 + 4) / 6))


def test_a_flight_without_take_off_has_no_phases():
    result = metrics.compute(flight(["waiting"] * 10).series(), INFO)
    assert result["phases"] == [] and result["trajectory"] is None
    assert result["position_3d_m"] is None


def test_the_landing_is_judged_at_the_scenarios_own_end():
    made = flight()
    made.values[:, COLUMNS["reference.x"]] = 2.0  # take-off point (2, 0), landed at (0.03, 0.04)
    series = made.series()
    assert metrics.compute(series, INFO)["landing_error_m"] == pytest.approx(math.hypot(1.97, 0.04))
    there = metrics.compute(series, INFO | {"landing_point": [0.03, 0.0]})
    assert there["landing_error_m"] == pytest.approx(0.04)


def test_a_completed_mission():
    result = metrics.compute(flight().series(), INFO)
    assert result["mission_completed"] is True
    assert result["shortfalls"] == []
    assert result["abort_reason"] is None
    assert result["payload_lifted"] is True
    assert result["payload_lift_height_m"] == pytest.approx(0.3)
    assert result["payload_lifted_at_s"] == 1.0
    assert result["payload_place_error_m"] == pytest.approx(0.05)
    assert result["landing_error_m"] == pytest.approx(0.05)
    assert {key: result[key] for key in metrics.PASSED_ON} == {
        key: INFO[key] for key in metrics.PASSED_ON
    }
    assert "latency_ms" not in result


def test_a_payload_that_hangs_lower_than_it_stood_is_lifted_one_that_falls_is_not():
    made = flight()
    made.values[4:6, COLUMNS["payload.z"]] = 0.6
    made.values[4:6, COLUMNS["payload.x"]] = 0.2
    result = metrics.compute(made.series(), INFO)
    assert result["payload_lifted"] is True
    assert result["payload_lift_height_m"] == 0.0
    made.values[5, COLUMNS["payload.z"]] = 0.03
    result = metrics.compute(made.series(), INFO)
    assert result["payload_lifted"] is False
    assert result["payload_lifted_at_s"] is None


@pytest.mark.parametrize(
    ("rows", "column", "value", "shortfall"),
    [
        (slice(0, 10), "payload.z", 0.7, "payload not lifted (rose 0.000 m)"),
        (slice(6, 10), "payload.x", 1.2, "payload 0.40 m from the drop point"),
        (slice(9, 10), "payload.z", 0.1, "payload still moving at the end"),
        (slice(8, 10), "truth.x", 0.3, "landed 0.30 m from the landing point"),
    ],
)
def test_each_shortfall_keeps_the_mission_from_being_completed(rows, column, value, shortfall):
    made = flight()
    made.values[rows, COLUMNS[column]] = value
    result = metrics.compute(made.series(), INFO)
    assert result["mission_completed"] is False
    assert result["shortfalls"] == [shortfall]


def test_a_flight_that_never_ended_or_never_began_is_not_completed():
    going = flight(["waiting"] * 2 + ["hover"] * 8).series()
    assert metrics.compute(going, INFO)["shortfalls"] == ["not landed"]
    waiting = flight(["waiting"] * 10, payload=False).series()
    result = metrics.compute(waiting, INFO)
    assert result["shortfalls"] == ["never took off"]
    assert result["rms"]["position_m"] == [None, None, None]
    json.dumps(result, allow_nan=False)


def test_an_abort_is_the_reason_and_ends_the_flight():
    made = flight(["waiting"] * 2 + ["carry"] * 3 + ["aborted"] * 5)
    made.values[5:, COLUMNS["truth.z"]] = -50.0
    result = metrics.compute(made.series(), INFO | {"abort_reason": "tilt 70 deg exceeds 60 deg"})
    assert result["mission_completed"] is False
    assert result["shortfalls"] == ["aborted: tilt 70 deg exceeds 60 deg"]
    assert result["abort_reason"] == "tilt 70 deg exceeds 60 deg"
    assert result["max"]["position_m"][2] == 0.0
    assert result["landing_error_m"] is None


def test_without_a_payload_no_place_error_is_required():
    info = INFO | {"payload_mass_kg": 0.0, "drop_point": None}
    result = metrics.compute(flight(payload=False).series(), info)
    assert result["mission_completed"] is True
    assert result["payload_lifted"] is None
    assert result["payload_place_error_m"] is None


def test_latency_belongs_to_realtime_flights():
    latency = np.array([1.0, 2.0, 3.0, 4.0, 10.0]) * 1e-3
    info = INFO | {"clock": "realtime", "missed_ticks": 2}
    result = metrics.compute(flight().series(), info, latency)
    # linear interpolation: the 99th percentile lies 0.96 of the way from 4 ms to 10 ms
    assert result["latency_ms"] == pytest.approx({"p50": 3.0, "p99": 9.76, "max": 10.0})
    assert result["missed_ticks"] == 2
    assert "latency_ms" not in metrics.compute(flight().series(), INFO, latency)
    nothing = metrics.compute(flight().series(), info)
    assert nothing["latency_ms"] == {"p50": None, "p99": None, "max": None}


def test_clamps_are_counted_before_the_law_is_reset_on_the_ground():
    made = flight()
    assert "clamps" in metrics.compute(made.series(), INFO)
    made.values[:, COLUMNS.block("adaptation.")] = np.nan
    assert "clamps" not in metrics.compute(made.series(), INFO)  # a law without clamps
    for subsystem, counted in (("position", 3.0), ("attitude", 0.0), ("arm", 1.0)):
        made.values[:8, COLUMNS[f"adaptation.{subsystem}.clamps"]] = counted
        made.values[8:, COLUMNS[f"adaptation.{subsystem}.clamps"]] = 0.0
    found = metrics.compute(made.series(), INFO)["clamps"]
    assert found == {"position": 3, "attitude": 0, "arm": 1}
