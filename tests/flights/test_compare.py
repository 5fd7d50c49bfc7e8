"""The shortest `uam compare` from the command line."""

import json
from dataclasses import replace

import pytest

from uam_lab.cli.main import main
from uam_lab.experiments.compare import plan
from uam_lab.experiments.trials import trial


def compare(out, *options):
    status = main(
        [
            "compare",
            "--rows",
            "proposed",
            "--seeds",
            "1",
            "--payload-mass",
            "0.2",
            "--out",
            str(out),
            *options,
        ]
    )
    assert status == 0
    return json.loads((out / "comparison.json").read_text())


@pytest.mark.slow
def test_a_comparison_is_written_and_repeats(tmp_path, capsys):
    first = compare(tmp_path / "a")
    (row,) = first["rows"].values()
    assert row["flights"] == row["completed"] == 1 and row["lost"] == 0
    assert "equal bit for bit" in first["claims"][-1]
    assert first["seeds"] == [1] and first["payloads_kg"] == [0.2] and first["engine"] == "direct"
    assert "docs/tuning.md" in first["budgets"]["proposed"]
    for name in ("position_errors", "rms", "gains"):
        assert (tmp_path / "a" / "figures" / f"{name}.png").stat().st_size > 0
    assert "proposed" in (tmp_path / "a" / "report.html").read_text()
    assert "RMS position error" in capsys.readouterr().out
    assert compare(tmp_path / "b", "--jobs", "1")["rows"] == first["rows"]


@pytest.mark.parametrize(
    "options, message",
    [
        (["--seeds", "0"], "1 or more"),
        (["--payload-mass", "9"], "at most 5"),
        (["--profile", "mine"], "LABEL=FILE"),
        (["--rows", "proposed", "--profile", "proposed=asmc1"], "the row proposed is there"),
    ],
)
def test_wrong_use_is_refused_in_one_line(options, message, tmp_path, capsys):
    try:
        status = main(["compare", "--out", str(tmp_path), *options])
    except SystemExit as stop:  # argparse
        status = stop.code
    assert status == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1


@pytest.mark.slow
def test_a_trial_through_the_nodes_is_the_trial_of_the_direct_engine():
    (proposed,) = plan.entries(["proposed"]).items()
    requested = trial.Trial(*proposed, 0.0, 1, scenario="hover")
    through_ros, direct = trial.measure(replace(requested, engine="ros")), trial.measure(requested)
    assert through_ros.completed and direct.completed
    assert through_ros.rms == pytest.approx(direct.rms, rel=1e-3)
