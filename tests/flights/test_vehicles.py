"""The vehicles that are data alone, flown in both engines and judged by metrics.

Hexacopter with the 2R arm, S-500 with a 3R arm: config/vehicle/, each with its own profile.
"""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from whole_flight import SHORT, Flight

from uam_control.laws.modular import ModularLaw
from uam_control.mission import load_scenario
from uam_control.profiles.profile import default_profile
from uam_control.supervision import State
from uam_control.vehicle import load_description
from uam_lab.flight.direct.flight import DirectFlight
from uam_lab.results import timeseries
from uam_lab.results.metrics import compute
from uam_sim_bridge.plant import Vehicle

FLIGHTS = [
    ("hexa_arm", "hover"),
    ("hexa_arm", "circle"),
    ("hexa_arm", "arm_motions"),
    ("s500_arm3", "hover"),
    ("s500_arm3", "circle_arm3"),
    ("s500_arm3", "arm3_motions"),
]
LIMITS = {"position_m": 0.02, "attitude_deg": 0.5, "arm_deg": 1.5}  # RMS of every axis


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


def test_motions_reach_every_joint_of_three():
    series = fly("s500_arm3", "arm3_motions").recording.series()
    moved = [np.ptp(series[f"truth.alpha_{i}"]) for i in (1, 2, 3)]
    # 40 to -40, 90 to 30 and 60 to -60 degrees
    assert np.degrees(moved) == pytest.approx([80.0, 60.0, 120.0], abs=4.0)


def test_the_third_joint_is_supervised():
    # its limit at 0.5 rad, while the motions take it to 60 deg
    flight = fly("s500_arm3", "arm3_motions", joint_angle_hold=(1.9, 1.9, 0.5))
    held = next(change for change in flight.mission.changes if change.target is State.HOLDING)
    assert "joint angle" in held.cause and "of its limit" in held.cause
    series = flight.recording.series()
    row = series.row_at(held.stamp - flight.mission.changes[0].stamp)
    # the limit counts after hold_after, while the joint goes on
    assert series["truth.alpha_3"][row] > 0.5 > abs(series["truth.alpha_1"][row])


@pytest.mark.parametrize("name", ["hexa_arm", "s500_arm3"])
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
