"""The tuner's search space, cost and file, and a short search."""

import dataclasses
import math
import re
from itertools import pairwise

import numpy as np
import optuna
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from uam_control.profiles.profile import load_profile
from uam_control.settings import configuration
from uam_lab.cli.main import main
from uam_lab.experiments.trials.trial import TrialResult
from uam_lab.experiments.tuning import front, search_results
from uam_lab.experiments.tuning.search import Task, evaluated_start, open_study
from uam_lab.experiments.tuning.space import Cost, TuningError, load_space

COST = Cost(
    aim=(1.0,) * 8,
    peak_weight=0.5,
    restless_weight=0.1,
    restless_allowed=(2.0, 4.0),
    not_completed=3.0,
    lost=100.0,
)
FLIGHT = TrialResult(
    label="x",
    payload_mass=0.2,
    seed=1,
    rms=np.full(8, 2.0),
    largest=np.full(8, 10.0),
    flown=1.0,
    cut_short=False,
    outcome="completed",
    why="",
    place_error=0.01,
    restless=(2.0, 8.0),
    peaks={},
)
SPACE = {
    "controller": "modular",
    "flights": [{"payload_mass": 0.0, "seed": 3, "scenario": "hover"}],
    "cost": {
        "aim": [0.025, 0.01, 0.045, 1.6, 1.4, 1.5, 0.6, 0.6],
        "peak_weight": 0.3,
        "restless_weight": 0.1,
        "restless_allowed": [0.03, 0.02],
        "not_completed": 3.0,
        "lost": 100.0,
    },
    "knobs": [
        {
            "node": "position_controller",
            "parameter": "lambda_1",
            "entries": [0, 1],
            "low": 0.5,
            "high": 6.0,
        },
        {"node": "arm_controller", "parameter": "varpi", "low": 0.1, "high": 10.0},
    ],
}


def test_cost_worked_by_hand():
    # mean (2/1)^2 = 4; peak (10/5)^2 = 4, half of it 2; restless 0.1 (1 + 4) = 0.5
    assert COST.of(FLIGHT) == pytest.approx(6.5)
    assert COST.of(dataclasses.replace(FLIGHT, outcome="landed")) == pytest.approx(9.5)
    lost = dataclasses.replace(FLIGHT, cut_short=True, outcome="lost", flown=0.25)
    assert COST.of(lost) == pytest.approx(175.0)
    nothing = dataclasses.replace(FLIGHT, rms=np.full(8, np.nan), flown=0.0)
    assert COST.of(nothing) == pytest.approx(200.0)


def write(tmp_path, **changes):
    file = tmp_path / "space.yaml"
    file.write_text(yaml.safe_dump({**SPACE, **changes}))
    return str(file)


def test_a_knob_turns_what_it_names_and_nothing_else(tmp_path):
    space = load_space(write(tmp_path))
    first, second = space.knobs
    assert first.name == "position_controller.lambda_1[0,1]"
    made = space.profile({first.name: 3.14159, second.name: 2.0})
    start = load_profile("s500")
    old, new = start.sets["position_controller"], made.sets["position_controller"]
    assert new.lambda_1 == (3.142, 3.142, old.lambda_1[2])
    assert dataclasses.replace(new, lambda_1=old.lambda_1) == old
    assert made.sets["arm_controller"].varpi == 2.0
    assert made.sets["attitude_controller"] == start.sets["attitude_controller"]
    assert first.value(made) == 3.142


@pytest.mark.parametrize("name", configuration.names("tuning"))
def test_the_spaces_of_the_project_begin_inside_their_ranges(name):
    space = load_space(name)
    for knob in space.knobs:
        entry = knob.entries[0] if knob.entries else None
        value = getattr(space.start.sets[knob.nodes[0]], knob.parameter)
        value = value if entry is None else value[entry]
        assert knob.low <= value <= knob.high, knob.name


@pytest.mark.parametrize(
    ("knob", "complaint"),
    [
        ({"node": "nobody"}, "no such node"),
        ({"parameter": "lambda_9"}, "no such parameter"),
        ({"parameter": "record"}, "no such parameter"),  # of the class, but no parameter
        ({"high": 1e9}, "above 0, within 1e-09 to"),
        ({"entries": [3]}, "entries 0 to 2 are expected"),
        ({"entries": []}, "entries 0 to 2 are expected"),
        ({"low": 7.0}, "low < high are expected, above 0"),
    ],
)
def test_a_bad_knob_is_refused_by_name(tmp_path, knob, complaint):
    knobs = [{**SPACE["knobs"][0], **knob}]
    with pytest.raises(TuningError, match=complaint):
        load_space(write(tmp_path, knobs=knobs))


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"knobs": ["lambda"]}, "knobs[0]: a mapping expected, got 'lambda'"),
        ({"knobs": [{**SPACE["knobs"][1], "low": "small"}]}, "knobs[0].low: a number expected"),
        ({"knobs": [{**SPACE["knobs"][0], "entries": ["x"]}]}, "knobs[0].entries: a list of 0, 1"),
        ({"flights": [{"payload_mass": "heavy", "seed": 1}]}, "flights[0].payload_mass: a number"),
        ({"flights": [{"payload_mass": 0.1, "seed": 1, "wind": 3}]}, "flights[0].wind: unknown"),
        ({"cost": {**SPACE["cost"], "aim": [1.0]}}, "cost.aim: a list of 8 numbers expected"),
        ({"cost": {**SPACE["cost"], "aim": [0.0] * 8}}, "cost.aim: 0 is not above 0"),
        ({"cost": {**SPACE["cost"], "restless_allowed": [1, 0]}}, "restless_allowed: 0 is not"),
        ({"cost": {**SPACE["cost"], "lost": -1.0}}, "cost.lost: -1 is below 0"),
        ({"cost": None}, "cost: a mapping expected, got None"),
        ({"knobs": [SPACE["knobs"][1]] * 2}, "knobs: the same entries of a parameter twice"),
        ({"delay_margin": 0.05}, "delay_margin: a mapping expected, got 0.05"),
    ],
)
def test_a_bad_space_is_refused_in_one_line(tmp_path, changes, complaint):
    with pytest.raises(TuningError, match=re.escape(complaint)) as error:
        load_space(write(tmp_path, **changes))
    assert "\n" not in str(error.value)


def test_a_search_finds_goes_on_and_leaves_a_profile_that_loads(tmp_path, capsys):
    space, out = write(tmp_path), tmp_path / "out"
    arguments = ["tune", "--space", space, "--jobs", "1", "--out", str(out)]
    assert main([*arguments, "--evaluations", "2"]) == 0
    assert "best      evaluation" in capsys.readouterr().out
    assert main([*arguments, "--evaluations", "3"]) == 0
    rows = (out / "evaluations.csv").read_text().splitlines()
    assert len(rows) == 1 + 3
    costs = [float(row.split(",")[1]) for row in rows[1:]]
    assert len(set(costs)) == 3 and all(0.0 < cost < 100.0 for cost in costs)
    best = load_profile(str(out / "best.yaml"))
    assert best.sets["arm_controller"].varpi > 0.0
    assert (out / "search.png").stat().st_size > 0


def test_ctrl_c_says_how_the_search_goes_on(tmp_path, capsys, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("uam_lab.experiments.tuning.search.search", interrupted)
    assert main(["tune", "--space", write(tmp_path), "--out", str(tmp_path / "out")]) == 130
    assert "the same command continues the search" in capsys.readouterr().err


def test_a_storage_that_cannot_go_on_is_refused_in_one_line(tmp_path, capsys):
    file, out = write(tmp_path), tmp_path / "out"
    out.mkdir()
    journal = out / "study.journal"
    open_study(Task(load_space(file), "another", str(journal), 1, 1))
    assert main(["tune", "--space", file, "--out", str(out)]) == 2
    assert capsys.readouterr().err.endswith("has the study another: give another --out\n")
    journal.write_bytes(journal.read_bytes()[:-9])  # as of a search that was killed
    assert main(["tune", "--space", file, "--out", str(out)]) == 2
    complaint = "study.journal: its last line was not written to its end: remove it\n"
    assert capsys.readouterr().err.endswith(complaint)


@pytest.mark.long
def test_a_start_whose_evaluation_was_killed_is_evaluated_again(tmp_path, capsys):
    file, out = write(tmp_path), tmp_path / "out"
    out.mkdir()
    space = load_space(file)
    task = Task(space, space.name, str(out / "study.journal"), 1, 1)
    study = open_study(task)
    study.enqueue_trial(space.start_values)
    study.ask()  # stays running, as that of a killed worker
    assert evaluated_start(space, study) is None
    assert search_results.in_words(None) == "not evaluated"
    arguments = ["tune", "--space", file, "--jobs", "1", "--out", str(out), "--evaluations", "1"]
    assert main(arguments) == 0
    said = capsys.readouterr().out
    start = evaluated_start(space, open_study(task))
    assert start.number == 1
    assert f"start: {search_results.in_words(start)}" in said
    # other inputs give other costs: they do not continue this study
    for changes in (
        ["--plant-preset", "laboratory"],
        ["--space", write(tmp_path, flights=[{"payload_mass": 0.1, "seed": 3}])],
    ):
        assert main([*arguments, *changes, "--evaluations", "2"]) == 2
        complaint = capsys.readouterr().err
        assert "evaluations with other inputs (" in complaint and complaint.count("\n") == 1


def trials(*values):
    return [optuna.trial.create_trial(values=pair) for pair in values]


def test_the_front_by_hand():
    # the third is surpassed by the second, the fourth by the first
    all_of_them = trials((1.0, 0.05), (0.5, 0.02), (2.0, 0.01), (1.0, 0.04))
    found = front.front(all_of_them)
    assert [one.values for one in found] == [[0.5, 0.02], [1.0, 0.05]]
    # 20 ms ln(10 / 0.5) + 30 ms ln(10 / 1)
    expected = 20.0 * math.log(20.0) + 30.0 * math.log(10.0)
    assert front.area(all_of_them) == pytest.approx(expected)
    assert front.chosen(all_of_them, 0.03).values == [1.0, 0.05]
    assert front.chosen(all_of_them, 0.01).values == [0.5, 0.02]
    assert front.chosen(all_of_them, 0.2).values == [1.0, 0.05]  # none has enough


@given(st.lists(st.tuples(st.floats(0.01, 100.0), st.floats(0.0, 0.2)), min_size=1, max_size=12))
def test_the_area_of_the_front_never_falls_and_no_trial_surpasses_the_front(values):
    all_of_them = trials(*values)
    areas = front.hypervolumes(all_of_them)
    assert all(after >= before - 1e-9 for before, after in pairwise([0.0, *areas]))
    assert areas[-1] == pytest.approx(front.area(all_of_them))
    best = front.front(all_of_them)
    for cost, margin in values:
        assert any(one.values[0] <= cost and one.values[1] >= margin for one in best)


@pytest.mark.long
def test_a_search_with_two_objectives_draws_its_front(tmp_path, capsys):
    space, out = write(tmp_path, delay_margin={"at_least": 0.5}), tmp_path / "out"
    command = ["tune", "--space", space, "--jobs", "1", "--evaluations", "2", "--out", str(out)]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "delay margin 59.9 ms" in said  # of the flying profile
    assert "none found has 500 ms" in said
    header, *rows = (out / "evaluations.csv").read_text().splitlines()
    assert header.startswith("evaluation,cost,delay_margin_s,") and len(rows) == 2
    assert (out / "search.png").stat().st_size > 0


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--space", "nowhere.yaml"], "nowhere.yaml does not exist"),
        (["--step", "2"], "--step 2 is outside"),
        (["--profile", "nobody"], "unknown profile 'nobody'"),
    ],
)
def test_wrong_use_is_one_line(tmp_path, capsys, monkeypatch, arguments, complaint):
    monkeypatch.chdir(tmp_path)
    assert main(["tune", *arguments]) == 2
    message = capsys.readouterr().err
    assert message.startswith("uam tune: ") and complaint in message and message.count("\n") == 1


def test_convergence_by_hand():
    curve = [4.0, 3.0, 2.0, 1.99, 1.985]
    assert front.improvement(curve, 2) == pytest.approx(0.0075)  # from 2.0 to 1.985
    assert front.improvement(curve, 4) == pytest.approx(2.015 / 4.0)
    assert front.improvement(curve, 5) == math.inf
    assert front.convergence(curve, 2).startswith("converged: the last 2 of 5 evaluations")
    assert front.convergence(curve, 4).startswith("not converged: the last 4")
    assert front.convergence(curve, 9).startswith("not converged: 5 evaluations")
    assert front.convergence(curve[:2], front.LEAST).startswith("not converged: 2 eval")
    assert front.convergence(curve[:1], 0).startswith("not converged")


@pytest.mark.long
def test_patience_ends_a_search_that_improves_no_more(tmp_path, capsys):
    # a knob that hardly moves: every evaluation costs nearly what the start costs
    varpi = load_profile("s500").sets["arm_controller"].varpi
    knobs = [{**SPACE["knobs"][1], "low": 0.999 * varpi, "high": 1.001 * varpi}]
    out = tmp_path / "out"
    command = ["tune", "--space", write(tmp_path, knobs=knobs), "--jobs", "1", "--out", str(out)]
    assert main([*command, "--evaluations", "9", "--patience", "2"]) == 0
    assert "converged: the last 2 of 3 evaluations" in capsys.readouterr().out
    assert len((out / "evaluations.csv").read_text().splitlines()) == 1 + 3
