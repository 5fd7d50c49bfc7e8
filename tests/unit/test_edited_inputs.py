"""Rows of a table belong to the content of the input files."""

from dataclasses import replace

import pytest
from adapting.flights import StudyFlight, mark

from uam_control.profiles.profile import load_profile
from uam_control.settings import configuration
from uam_lab.cli.main import main
from uam_lab.experiments.trials import experiment
from uam_lab.experiments.trials.rows import RowTableError


@pytest.fixture
def scenario(tmp_path):
    """A scenario file of the user."""
    file = tmp_path / "mine.yaml"
    file.write_text(configuration.path("scenarios/hover.yaml").read_text())
    return file


def edit(file):
    """Change a file so that it means the same: its rows may still be others."""
    file.write_text(file.read_text() + "# edited\n")


@pytest.mark.parametrize("command", ["campaign", "compare --rows proposed", "faults"])
def test_rows_are_of_other_flights_after_an_edit_of_the_scenario(
    scenario, tmp_path, monkeypatch, command
):
    found = []

    def table(file, schema, of):
        found.append(repr(of))
        raise RowTableError("nothing flies here")

    monkeypatch.setattr(experiment, "RowTable", table)
    matrix = tmp_path / "matrix.yaml"
    matrix.write_text(
        "{scenario: hover, moments: {a: {at: 3}}, faults: [{fault: servo_jam, joint: 1}]}"
    )
    words = [*command.split(), "--scenario", str(scenario), "--out", str(tmp_path / "out")]
    words += ["--matrix", str(matrix)] if command == "faults" else []
    assert main(words) == 2 and main(words) == 2
    edit(scenario)
    assert main(words) == 2
    assert found[0] == found[1] != found[2]


def test_a_study_knows_an_edited_scenario_and_another_vehicle_of_the_same_name(scenario):
    profile = load_profile("s500")
    trial = StudyFlight("row", profile, 0.0, 1, str(scenario), condition="nominal")
    before = mark(trial)
    assert mark(replace(trial)) == before
    heavier = replace(profile.vehicle, numbers=profile.vehicle.numbers | {"ground": 1.0})
    edited = replace(trial, profile=replace(profile, vehicle=heavier))
    assert mark(edited) != before
    edit(scenario)
    assert mark(trial) != before
