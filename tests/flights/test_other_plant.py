"""Another physics engine is one class: it flies with the direct engine and over ROS."""

import os

import numpy as np
import pytest
from whole_flight import ROOT, Flight

from uam_lab.records.results import timeseries

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
