"""What a resumed campaign must have unchanged: each input is named, and shows a change."""

from __future__ import annotations

import dataclasses
import shutil

import pytest

from uam_control.settings.configuration import path
from uam_control.vehicle import load_description
from uam_lab.cli.campaign import usual_ranges
from uam_lab.cli.command import again, given_profile
from uam_lab.cli.main import main
from uam_lab.cli.parser import parsed
from uam_lab.experiments.trials.carried import inputs


@pytest.fixture
def folder(tmp_path):
    shutil.copytree(path("vehicle/parts"), tmp_path / "parts")
    for name in ("s500_arm.yaml", "s500_arm.xml"):
        shutil.copy(path("vehicle") / name, tmp_path)
    shutil.copy(path("scenarios/hover.yaml"), tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("file", "text", "named"),
    [
        ("s500_arm.xml", "<mujoco", "model (MJCF and its files)"),
        ("parts/world.xml", "<mujoco", "model (MJCF and its files)"),
        ("s500_arm.yaml", "gust: 0.0", "vehicle"),
        ("hover.yaml", "description", "scenario"),
    ],
)
def test_each_file_that_is_read_is_an_input(folder, file, text, named):
    def now():
        return inputs(load_description(folder / "s500_arm.yaml"), str(folder / "hover.yaml"), {})

    before, content = now(), (folder / file).read_text()
    assert before == now() and text in content
    changed = {"gust: 0.0": "gust: 0.5", "<mujoco": "<!-- --><mujoco"}
    (folder / file).write_text(content.replace(text, changed.get(text, f"#\n{text}"), 1))
    after = now()
    assert [name for name in before if before[name] != after[name]] == [named]


def test_gains_options_and_code_are_inputs():
    vehicle = load_description()
    before = inputs(vehicle, "hover", {"--seed": "1"})
    gains = vehicle.autopilot_gains | {"MC_ROLLRATE_P": 0.5}
    other = dataclasses.replace(vehicle, autopilot_gains=gains)
    after = inputs(other, "hover", {"--seed": "2"})
    assert [name for name in before if before[name] != after[name]] == ["--seed", "autopilot gains"]
    assert {"python", "mujoco", "sources and configuration of uam", "laws"} <= before.keys()


@pytest.mark.parametrize(
    ("presets", "ranges"),
    [
        ([], "robustness"),
        (["calm"], "robustness"),
        (["laboratory"], "laboratory"),
        (["laboratory", "mine.yaml"], "laboratory"),
    ],
)
def test_the_ranges_are_those_of_the_plant_if_it_has_some(presets, ranges):
    assert usual_ranges(presets) == ranges


@pytest.mark.parametrize("command", ["campaign", "faults", "margins", "tune"])
def test_a_later_profile_overrides_an_earlier_one(command):
    """config/profiles/hand.yaml has a hand_bandwidth of 4 rad/s and nothing else."""
    options = parsed([command, "--profile", "s500", "--profile", "hand"])
    profile = given_profile(options.profile, load_description())
    assert profile.name == "s500+hand"
    assert profile.sets["arm_controller"].hand_bandwidth == 4.0
    alone = given_profile(["s500"], load_description()).sets
    assert profile.sets["position_controller"] == alone["position_controller"]


def test_the_command_that_flies_a_cell_again_has_each_option_once_per_value():
    words = ["faults", "--profile", "s500", "--profile", "hand", "--plant-preset", "laboratory"]
    options = parsed([*words, "--seed", "3", "--vehicle", "s500_arm"])
    where = {"engine": options.engine, "scenario": "hover"}
    found = again("fly", options, **where, seed=options.seed, vehicle=options.vehicle)
    assert found == (
        "uam fly --engine direct --scenario hover --seed 3 --vehicle s500_arm "
        "--profile s500 --profile hand --plant-preset laboratory"
    )


def test_ctrl_c_says_what_continues(tmp_path, capsys, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("uam_lab.experiments.trials.experiment.flown_by", interrupted)
    out = tmp_path / "out"
    assert main(["campaign", "--flights", "2", "--out", str(out)]) == 130
    said = f"uam campaign: interrupted; the same command with --out {out} continues\n"
    assert capsys.readouterr().err.endswith(said)


@pytest.mark.parametrize("command", ["campaign", "compare", "faults"])
def test_a_scenario_beyond_the_limits_is_refused_before_any_flight(command, tmp_path, capsys):
    out = tmp_path / "out"
    more = ["--matrix", "random", "--draws", "2"] if command == "faults" else []
    assert main([command, "--scenario", "race_10", "--out", str(out), *more]) == 2
    assert "scenario race_10: x 13.5 m exceeds 5 m at 10.7 s" in capsys.readouterr().err
    assert not out.exists()
