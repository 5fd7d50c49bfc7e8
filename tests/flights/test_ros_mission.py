"""The paper's mission through every node, as `make fly` flies it."""

import json

import numpy as np
import pytest

from uam_lab.records.results import timeseries
from uam_lab.report.facts.paper import RMS


@pytest.mark.slow
def test_the_papers_mission_through_every_node(fly):
    flight = fly()
    assert flight.wait(patience=700.0) == 0, flight.said + flight.complained
    found = json.loads((flight.out / "metrics.json").read_text())
    assert found["mission_completed"] and found["payload_lifted"]
    assert found["payload_place_error_m"] < 0.15 and found["landing_error_m"] < 0.15
    for group, paper in RMS.items():
        assert np.all(np.array(found["rms"][group]) <= paper), (group, found["rms"][group])
    series = timeseries.read(flight.out / "timeseries.parquet")
    height = series["payload.z"]
    assert height[series.row_at(39.0)] > height[series.row_at(34.9)] + 0.05
    assert height[series.row_at(69.9)] > 0.5 and height[series.row_at(71.5)] < 0.1
