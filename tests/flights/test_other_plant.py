"""Another physics engine is one class: it flies with the direct engine and over ROS."""

import os

import numpy as np
import pytest
from whole_flight import ROOT, Flight

from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.flights.direct import flight as direct
from uam_lab.records.results import timeseries
from uam_sim_bridge.plant import Vehicle

PLANT = "rigid_body_plant:RigidBodyPlant"


# over ROS as examples/own_simulator.py
@pytest.mark.parametrize("engine", ["direct", pytest.param("ros", marks=pytest.mark.slow)])
def test_a_plant_of_ones_own_hovers(engine, short_scenario, tmp_path, monkeypatch):
    paths = (str(ROOT / "tests"), os.environ.get("PYTHONPATH", ""))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, paths)))
    options = ("--engine", engine, "--plant", PLANT, "--scenario", str(short_scenario))
    flight = Flight(tmp_path, *options)
    try:
        assert flight.wait() == 0, flight.said + flight.complained
    finally:
        flight.end()
    series = timeseries.read(flight.out / "timeseries.parquet")
    hover = series.in_phase("hover")
    error = series.block("error.")[hover, :3]
    assert hover.any() and np.abs(error).max() < 0.05
    # nothing of MuJoCo's noise and payload: the plant was this one
    assert np.isnan(series["payload.z"]).all() and series["truth.z"].max() > 0.55


def hover():
    """Return a flight of the direct engine with this plant, not begun."""
    return direct.DirectFlight(
        load_scenario("hover"), load_profile("s500"), Vehicle.load(), 0.0, 1, plant=PLANT
    )


def test_a_plant_that_does_not_count_its_ticks_ends_the_flight(monkeypatch):
    flight = hover()
    monkeypatch.setattr(flight.plant, "step", lambda *inputs: None)
    flight.run()
    assert flight.ended_by.endswith("RigidBodyPlant.step() does not add 1 to `tick`")


@pytest.mark.parametrize(
    ("pose", "why"),
    [(lambda mocap: None, "a sensor without samples"), (lambda m: (*m[:2], 0 * m[2]), "diverged")],
)
def test_a_plant_without_usable_poses_ends_before_take_off_with_the_reason(pose, why, monkeypatch):
    """No tick of the mission comes then: it cannot end by itself."""
    monkeypatch.setattr(direct, "LONGEST_WAIT", 3.0)
    flight = hover()
    sense = flight.plant.sense

    def sensed():
        samples = sense()
        samples.mocap = samples.mocap and pose(samples.mocap)
        return samples

    monkeypatch.setattr(flight.plant, "sense", sensed)
    flight.run()
    assert flight.plant.time < 5.0
    assert "no state of the estimator" in flight.ended_by and why in flight.ended_by
