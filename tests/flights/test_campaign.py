"""`uam campaign` with a few random flights, and a short `uam compare`."""

import csv
import json
import shlex
import shutil

import numpy as np
import pyarrow.parquet as pq
import pytest
from distributed import LocalCluster
from longer import longer

from uam_control.profiles.profile import load_profile
from uam_control.settings import configuration
from uam_lab.cli import fly as fly_command
from uam_lab.cli.main import main
from uam_lab.experiments.campaign.variations import Draws, VariationError, common, ranges
from uam_lab.experiments.trials.outcome import LANDED, classify
from uam_lab.experiments.trials.trial import figures_of, recorded
from uam_lab.records.results.phase_errors import GROUPS
from uam_sim_bridge.plant.effects import presets

FLIGHTS = 4


def draws(total, seed):
    """Random flights of the flying profile."""
    return Draws(load_profile("s500"), total, seed, ranges())


def test_a_draw_repeats_and_a_longer_one_begins_alike():
    few, many = draws(3, 5), draws(6, 5)
    assert [d.drawn for d in few] == [many[k].drawn for k in range(3)]
    assert [d.vehicle_changes for d in few] == [many[k].vehicle_changes for k in range(3)]
    assert draws(1, 6)[0].drawn != few[0].drawn
    assert all(tuple(d.drawn) == many.names for d in many)
    for name, (low, high) in ranges().items():
        assert all(low <= d.drawn[name] <= high for d in many), name


def test_single_draws_are_chosen_by_number():
    five = draws(5, 1)
    assert five.chosen("4,0,4") == [0, 4] and five[4].seed == 100_004
    assert list(five.chosen("")) == [0, 1, 2, 3, 4]
    for wrong in ("5", "-1", "1;2", "1,"):
        with pytest.raises(VariationError, match="numbers of 0 to 4"):
            five.chosen(wrong)


def test_what_failures_have_in_common_is_found():
    forty = list(draws(40, 1))
    values = {name: np.array([d.drawn[name] for d in forty]) for name in ("wind", "mass")}
    name, lost, kept, distance = common(values, values["wind"] > 4.0)[0]
    assert name == "wind" and lost > 4.0 > kept and distance > 1.0


@pytest.mark.long
@pytest.mark.parametrize(
    ("number", "stands"),
    [(13, True), (15, False)],  # a rotor needs 1.13 of its thrust at the pick; 1.09 at the drop
)
def test_a_payload_that_a_rotor_cannot_hold_costs_no_vehicle(number, stands):
    """Both were carried along the floor before; one of them was lost."""
    effects = presets.read(["laboratory"], ())
    flown = Draws(load_profile("s500"), 1000, 1, ranges(), effects=effects)[number]
    outcome = recorded(flown)
    figures = figures_of(flown, outcome, outcome.abort_reason)
    assert classify(outcome.series, figures) == LANDED
    assert ("set down" in outcome.grasps[-2]["text"]) is stands
    height = outcome.series["payload.z"][-1]
    assert bool(height > 0.6) is stands  # on its stand, or beside the vehicle


@pytest.mark.parametrize(
    "scenario",
    [
        longer("hover"),
        pytest.param("pick_and_place", marks=pytest.mark.slow),
    ],
)
def test_most_random_flights_are_flown_to_the_end(scenario, tmp_path, capsys, monkeypatch):
    mine, out = tmp_path / "mine.yaml", tmp_path / "out"
    shutil.copy(configuration.path(f"scenarios/{scenario}.yaml"), mine)
    command = ["campaign", "--scenario", str(mine), "--jobs", "1", "--out", str(out)]
    assert main([*command, "--flights", str(FLIGHTS)]) == 0
    found = json.loads((out / "campaign.json").read_text())
    assert found["flights"] == FLIGHTS and found["outcomes"]["lost"] == 0
    completed = found["outcomes"]["completed"]
    assert completed >= FLIGHTS // 2 and sum(found["outcomes"].values()) == FLIGHTS
    assert f"{completed} of {FLIGHTS} flights completed" in capsys.readouterr().out
    rows = list(csv.DictReader((out / "flights.csv").open()))
    assert len(rows) == FLIGHTS
    assert all(np.isfinite(float(row["rms.x"])) for row in rows)
    assert (out / "campaign.png").stat().st_size > 0

    page = (out / "report.html").read_text()
    worst = found["worst"][0]
    assert len(found["worst"]) == FLIGHTS and page.count("--replay</code>") == FLIGHTS

    whole = (out / "flights.parquet").read_bytes()
    for file in ("flights.csv", "report.html"):
        (out / file).unlink()
    assert main([*command, "--flights", str(FLIGHTS)]) == 0
    assert f"continuing after {FLIGHTS} earlier flights" in capsys.readouterr().out
    assert (out / "flights.parquet").read_bytes() == whole
    assert main([*command, "--seed", "2"]) == 2
    assert "give another --out" in capsys.readouterr().err

    # the worst one again, by the command of the report; without its report and video
    fly = fly_command.fly
    monkeypatch.setattr(fly_command, "fly", lambda settings, **_: fly(settings, False, False))
    again = shlex.split(worst["again"])[1:]
    assert main([*again, "--out", str(out / "again")]) == (worst["outcome"] != "completed")
    metrics = json.loads((out / "again/metrics.json").read_text())
    row = pq.read_table(out / "flights.parquet").to_pylist()[worst["flight"]]
    flown = [value for name, value in row.items() if name.startswith("rms.")]
    assert flown == [value for key, _, _ in GROUPS for value in metrics["rms"][key]]

    # the same table by two workers of a scheduler that are given everything but the sources
    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address=None,
        silence_logs=50,
    ) as cluster:
        there = ["--flights", str(FLIGHTS), "--out", str(tmp_path / "there")]
        there += ["--scheduler", cluster.scheduler_address]
        assert main(["campaign", "--scenario", str(mine), *there]) == 0
    assert (tmp_path / "there/flights.parquet").read_bytes() == whole


def test_replay_and_workers_are_refused_in_one_line(capsys):
    for options, text in (
        (["campaign", "--replay"], "--replay needs one flight"),
        (["campaign", "--jobs", "2", "--scheduler", "tcp://x:1"], "--jobs is for this machine"),
        (["faults", "--engine", "ros", "--jobs", "2"], "one flight at a time"),
    ):
        assert main(options) == 2
        error = capsys.readouterr().err
        assert text in error and error.count("\n") == 1
