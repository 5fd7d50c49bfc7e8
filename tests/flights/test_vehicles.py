"""The vehicles that are data alone, flown in both engines and judged by metrics.

Hexacopter with the 2R arm, S-500 with a 3R arm: config/vehicle/, each with its own profile.
"""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
import tilted_arm
import yaml
from longer import longer
from whole_flight import SHORT, Flight

from uam_control.laws.modular import ModularLaw
from uam_control.mission import load_scenario
from uam_control.profiles.profile import default_profile
from uam_control.supervision import State
from uam_control.vehicle import load_description
from uam_lab.cli.main import main
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.records.results import timeseries
from uam_lab.records.results.metrics import compute
from uam_sim_bridge.plant import Vehicle

FLIGHTS = [
    ("hexa_arm", "hover"),
    ("hexa_arm", "circle"),
    ("hexa_arm", "arm_motions"),
    ("s500_arm3", "hover"),
    ("s500_arm3", "circle_arm3"),
    ("s500_arm3", "arm3_motions"),
]
LIMITS = {"position_m": 0.02, "attitude_deg": 0.6, "arm_deg": 1.5}  # RMS of every axis


def fly(name, scenario, **mission):
    """A flight in the direct engine; mission: parameters of the supervisor that differ."""
    described = load_description(name)
    profile = default_profile(ModularLaw.kind.law, described)
    changed = dataclasses.replace(profile.sets["mission"], **mission)
    changed = changed.validated(len(described.joints))
    profile = dataclasses.replace(profile, sets=profile.sets | {"mission": changed})
    flight = DirectFlight(
        load_scenario(scenario, described), profile, Vehicle.of(described), 0.0, seed=1
    )
    flight.run()
    return flight


def judged(flight):
    """The metrics of a flight."""
    return compute(flight.recording.series(), {"abort_reason": flight.mission.output.abort_reason})


@pytest.mark.parametrize(("name", "scenario"), FLIGHTS)
def test_it_flies_in_the_direct_engine(name, scenario):
    flight = fly(name, scenario)
    found = judged(flight)
    assert found["mission_completed"], found["shortfalls"]
    states = [change.target for change in flight.mission.changes]
    assert states == [State.TAKING_OFF, State.FLYING, State.LANDING, State.DISARMED]
    joints, rotors = len(flight.plant.vehicle.description.joints), flight.recording.columns.rotors
    assert len(found["rms"]["arm_deg"]) == joints
    assert rotors == len(flight.plant.vehicle.description.rotors)
    for group, limit in LIMITS.items():
        assert max(found["rms"][group]) < limit, (group, found["rms"])
    if scenario == "arm3_motions":
        series = flight.recording.series()
        moved = [np.ptp(series[f"truth.alpha_{i}"]) for i in (1, 2, 3)]
        # 40 to -40, 90 to 30 and 60 to -60 degrees
        assert np.degrees(moved) == pytest.approx([80.0, 60.0, 120.0], abs=4.0)


MOTIONS = """
arm_start: {alpha_1_deg: 0, alpha_2_deg: 0, alpha_3_deg: 80}
moves:
  - {coordinate: z, from: 0, until: 3, to: 1.2}
  - {coordinate: alpha_1, from: 3, until: 5, to_deg: 60}
  - {coordinate: alpha_2, from: 4, until: 6, to_deg: -40}
  - {coordinate: alpha_3, from: 5, until: 7, to_deg: 20}
  - {coordinate: alpha_1, from: 7, until: 9, to_deg: 0}
  - {coordinate: alpha_2, from: 7, until: 9, to_deg: 0}
  - {coordinate: alpha_3, from: 7, until: 9, to_deg: 80}
landing: {at: 10, duration: 5}
"""


def test_an_arm_of_any_axis_on_a_tilted_mount_flies(tmp_path):
    scenario = tmp_path / "motions.yaml"
    scenario.write_text(MOTIONS)
    found = judged(fly(str(tilted_arm.make(tmp_path)), str(scenario)))
    assert found["mission_completed"], found["shortfalls"]
    assert max(found["rms"]["position_m"]) < 0.01
    assert max(found["rms"]["attitude_deg"]) < 0.4, found["rms"]
    assert max(found["rms"]["arm_deg"]) < 0.5, found["rms"]


def test_the_third_joint_is_supervised():
    # its limit at 0.5 rad, while the motions take it to 60 deg
    flight = fly("s500_arm3", "arm3_motions", joint_angle_hold=(1.9, 1.9, 0.5))
    held = next(change for change in flight.mission.changes if change.target is State.HOLDING)
    assert "joint angle" in held.cause and "of its limit" in held.cause
    series = flight.recording.series()
    row = series.row_at(held.stamp - flight.mission.changes[0].stamp)
    # the limit counts after hold_after, while the joint goes on
    assert series["truth.alpha_3"][row] > 0.5 > abs(series["truth.alpha_1"][row])


@pytest.mark.parametrize("name", [longer("hexa_arm"), "s500_arm3"])
def test_it_flies_through_the_nodes(name, tmp_path):
    scenario = tmp_path / "short.yaml"
    lines = SHORT.splitlines(keepends=True)
    scenario.write_text("".join(line for line in lines if not line.startswith("arm_start")))
    flight = Flight(tmp_path / name, "--vehicle", name, "--scenario", str(scenario), "--seed", "2")
    try:
        assert flight.wait() == 0, flight.said + flight.complained
        found = json.loads((flight.out / "metrics.json").read_text())
        series = timeseries.read(flight.out / "timeseries.parquet")
    finally:
        flight.end()
    described = load_description(name)
    assert found["vehicle"] == name and found["mission_completed"]
    assert len(found["rms"]["arm_deg"]) == len(described.joints) == series.columns.joints
    assert series.columns.rotors == len(described.rotors)
    rotors = [f"rotor_{i}.thrust" for i in range(1, series.columns.rotors + 1)]
    assert min(series[rotor].max() for rotor in rotors) > 1.0


@pytest.mark.long
def test_a_campaign_flies_the_joints_of_the_vehicle(tmp_path, capsys):
    command = ["campaign", "--vehicle", "s500_arm3", "--scenario", "hover", "--flights", "1"]
    command += ["--jobs", "1"]
    assert main([*command, "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.count("| alpha_3 |") == 1
    found = json.loads((tmp_path / "campaign.json").read_text())
    assert found["vehicle"] == "s500_arm3" and found["outcomes"]["completed"] == 1
    assert found["columns"] == list(load_description("s500_arm3").coordinates)
    assert len(found["rms_percentiles"]["50"]) == 9
    assert main([*command, "--seed", "2", "--out", str(tmp_path)]) == 2, "other flights"


@pytest.mark.long
def test_a_comparison_flies_the_joints_of_the_vehicle(tmp_path):
    command = ["compare", "--vehicle", "s500_arm3", "--scenario", "hover", "--rows", "proposed"]
    one = ["--seeds", "1", "--payload-mass", "0", "--jobs", "1"]
    assert main([*command, *one, "--out", str(tmp_path)]) == 0
    found = json.loads((tmp_path / "comparison.json").read_text())
    assert (found["vehicle"], found["scenario"]) == ("s500_arm3", "hover")
    assert len(found["rows"]["proposed"]["mean"]) == len(found["columns"]) == 9
    assert found["profiles"] == {"proposed": "s500_arm3.yaml"}
    assert "Vehicle s500_arm3, scenario hover" in (tmp_path / "report.html").read_text()


@pytest.mark.long
def test_a_fault_matrix_reaches_the_sixth_rotor(tmp_path, capsys):
    fault = {"fault": "motor_loss", "motor": 6, "remaining": 0.7}
    matrix = {"scenario": "hover", "moments": {"air": {"at": 5}}, "faults": [fault]}
    file, out = tmp_path / "matrix.yaml", tmp_path / "out"
    file.write_text(yaml.safe_dump(matrix))
    assert main(["faults", "--matrix", str(file), "--out", str(out)]) == 2
    assert "motor 6: the vehicle has 4" in capsys.readouterr().err and not out.exists()
    command = ["faults", "--matrix", str(file), "--vehicle", "hexa_arm", "--jobs", "1"]
    assert main([*command, "--out", str(out)]) == 0
    found = json.loads((out / "faults.json").read_text())
    assert found["vehicle"] == "hexa_arm"
    assert [flight["outcome"] for flight in found["flights"]] == ["completed", "completed"]


@pytest.mark.long
def test_a_search_starts_from_the_profile_of_the_vehicle(tmp_path, capsys):
    space = {
        "controller": "modular",
        "flights": [{"payload_mass": 0.0, "seed": 3, "scenario": "hover"}],
        "cost": {
            "aim": [1.0] * 9,
            "peak_weight": 0.3,
            "restless_weight": 0.1,
            "restless_allowed": [1.0, 1.0],
            "not_completed": 3.0,
            "lost": 100.0,
        },
        "knobs": [
            {
                "node": "arm_controller",
                "parameter": "lambda_1",
                "entries": [2],
                "low": 100.0,
                "high": 5000.0,
            }
        ],
    }
    file, out = tmp_path / "space.yaml", tmp_path / "out"
    file.write_text(yaml.safe_dump(space))
    command = ["tune", "--space", str(file), "--jobs", "1", "--evaluations", "1"]
    assert main([*command, "--out", str(out)]) == 2
    assert "entries 0 to 1 are expected" in capsys.readouterr().err
    assert main([*command, "--vehicle", "s500_arm3", "--out", str(out)]) == 0
    told = f"uam fly --vehicle s500_arm3 --controller modular --profile {out}/best.yaml"
    assert told in capsys.readouterr().out
    best = (out / "best.yaml").read_text()
    assert "from profile s500_arm3." in best and "Vehicle: s500_arm3." in best
    start = default_profile("modular", load_description("s500_arm3"))
    flown = yaml.safe_load(best)["arm_controller"]["ros__parameters"]["lambda_1"]
    assert flown == pytest.approx(start.sets["arm_controller"].lambda_1, rel=1e-3)
