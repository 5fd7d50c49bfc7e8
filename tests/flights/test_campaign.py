"""`uam campaign` with a few random flights, and a short `uam compare`."""

import csv
import json

import numpy as np
import pytest

from uam_control.profiles.profile import load_profile
from uam_lab.campaign.variations import VariationError, chosen, common, draw, ranges
from uam_lab.cli.main import main

FLIGHTS = 4


def test_a_draw_repeats_and_a_longer_one_begins_alike():
    profile = load_profile("s500")
    few, many = draw(profile, 3, seed=5), draw(profile, 6, seed=5)
    assert [d.values for d in few] == [d.values for d in many[:3]]
    assert [d.trial.vehicle_changes for d in few] == [d.trial.vehicle_changes for d in many[:3]]
    assert draw(profile, 1, seed=6)[0].values != few[0].values
    for name, (low, high) in ranges().items():
        assert all(low <= d.values[name] <= high for d in many), name


def test_single_draws_are_chosen_by_number():
    draws = draw(load_profile("s500"), 5, 1)
    assert [one.trial.seed for one in chosen(draws, "4,0,4")] == [100_000, 100_004]
    assert len(chosen(draws, "")) == 5
    for wrong in ("5", "-1", "1;2", "1,"):
        with pytest.raises(VariationError, match="numbers of 0 to 4 expected"):
            chosen(draws, wrong)


def test_what_failures_have_in_common_is_found():
    drawn = draw(load_profile("s500"), 40, seed=1)
    failed = [d.values["wind"] > 4.0 for d in drawn]
    name, lost, kept, distance = common(drawn, failed)[0]
    assert name == "wind" and lost > 4.0 > kept and distance > 1.0


@pytest.mark.parametrize(
    "scenario", ["hover", pytest.param("pick_and_place", marks=pytest.mark.slow)]
)
def test_most_random_flights_are_flown_to_the_end(scenario, tmp_path, capsys):
    command = ["campaign", "--scenario", scenario, "--out", str(tmp_path)]
    assert main([*command, "--flights", str(FLIGHTS)]) == 0
    found = json.loads((tmp_path / "campaign.json").read_text())
    assert found["flights"] == FLIGHTS and found["outcomes"]["lost"] == 0
    completed = found["outcomes"]["completed"]
    assert completed >= FLIGHTS // 2 and sum(found["outcomes"].values()) == FLIGHTS
    assert f"{completed} of {FLIGHTS} flights completed" in capsys.readouterr().out
    rows = list(csv.DictReader((tmp_path / "flights.csv").open()))
    assert len(rows) == FLIGHTS
    assert all(np.isfinite(float(row["rms x"])) for row in rows)
    assert (tmp_path / "campaign.png").stat().st_size > 0

    whole = (tmp_path / "flights.csv").read_bytes()
    kept = tmp_path / "flown.jsonl"
    kept.write_text(kept.read_text()[:-9])  # as after a kill while the last one was written
    assert main([*command, "--flights", str(FLIGHTS)]) == 0
    assert f"continuing after {FLIGHTS - 1} earlier flights" in capsys.readouterr().out
    assert (tmp_path / "flights.csv").read_bytes() == whole
    assert main([*command, "--seed", "2"]) == 2
    assert "give another --out" in capsys.readouterr().err
