"""A dry run: everything is computed and recorded, nothing is armed, and the end is a success."""

import json

import pytest


@pytest.mark.slow
def test_a_dry_run_ends_in_order(fly):
    flight = fly("--dry-run", "--scenario", "hover")
    assert flight.wait() == 0, flight.said + flight.complained
    metrics = json.loads((flight.out / "metrics.json").read_text())
    assert metrics["abort_reason"] == "dry run, time limit of 20 s: nothing was armed"
    assert "partial" not in flight.said and flight.complained == ""
    assert "armed" not in flight.said.replace("disarmed", "").replace("was armed", "")
