"""The pre-arm report: every check red by hand, and green without a fault."""

from __future__ import annotations

import numpy as np
import pytest

from uam_control.supervision import (
    Authority,
    Observation,
    Readings,
    SupervisionParameters,
    preflight,
)
from uam_control.supervision.checks import Checks
from uam_control.vehicle import derived_parameters, load_description

S500 = SupervisionParameters.among(derived_parameters(load_description())["mission"], 2)
ARM_START = (0.0, 1.5)
KNOWN = {"mocap_age": 0.01, "joint_age": 0.01, "controller_age": 0.01, "autopilot_age": 0.1}


def report(readings=None, state=None, **seen):
    """Return the checks by name; state: entries that differ from a vehicle at rest."""
    at = np.zeros((3, 8))
    at[0, 6:] = ARM_START
    for entry, value in (state or {}).items():
        at[entry] = value
    observation = Observation(at, np.zeros((3, 8)), on_ground=True, **seen)
    observation.readings = Readings(**(KNOWN | (readings or {})))
    checks = Checks(S500)
    checks.update(0.0, observation, False)
    return {c.name: c for c in preflight(checks, observation, ARM_START, 0.3, 0.3)}


def test_all_green_without_a_fault():
    found = report()
    assert all(check.passed for check in found.values()), found
    assert found["battery"].value == "unknown"
    assert found["mocap"].text == "mocap: 0.01 s (at most 0.1 s)"
    assert "position error" not in found  # of a flight


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("mocap", {"readings": {"mocap_age": 0.3}}),
        ("mocap", {"readings": {"mocap_age": np.nan}}),
        ("joint angles", {"readings": {"joint_age": np.nan}}),
        ("a controller", {"readings": {"controller_age": np.nan}}),
        ("autopilot", {"readings": {"autopilot_age": np.nan}}),
        ("autopilot", {"readings": {"autopilot_age": 0.8}}),
        ("setpoint delay", {"readings": {"round_trip": 0.041}}),
        ("battery", {"readings": {"battery": 0.05}}),
        ("servo temperature", {"readings": {"temperature": 99.0}}),
        ("control ticks", {"readings": {"missed_ticks": 200.0}}),
        ("tilt", {"state": {(0, 3): 0.9}}),
        ("body rate", {"state": {(1, 4): 9.0}}),
        ("geofence", {"state": {(0, 0): 6.0}}),
        ("estimate", {"state": {(2, 0): np.nan}}),
        ("motors", {"armed": True}),
        ("control", {"authority": Authority("the pilot, in HOLD")}),
        ("speed", {"state": {(1, 0): 0.31}}),
        ("arm", {"state": {(0, 7): 1.9}}),
    ],
)
def test_each_check_can_be_red(name, changes):
    found = report(**changes)
    red = [check for check in found.values() if not check.passed]
    assert any(name in check.name or check.name == "controllers" for check in red), red
    assert all("\n" not in check.text for check in red)
