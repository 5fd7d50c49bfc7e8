"""What travels with a trial to a worker without this machine's files."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from uam_control.profiles.profile import load_profile
from uam_control.settings import configuration
from uam_control.vehicle import load_description
from uam_lab.experiments.trials.carried import arrived, carried
from uam_lab.experiments.trials.trial import Trial
from uam_sim_bridge.plant import Vehicle


def test_names_of_the_configuration_need_nothing():
    profile = load_profile("s500")
    found = carried("hover", profile)
    assert found.scenario is None and not found.files
    assert arrived(found, profile).vehicle.model == profile.vehicle.model


def test_a_model_of_the_user_travels_with_the_files_that_it_includes(tmp_path, monkeypatch):
    own = tmp_path / "own"
    shutil.copytree(configuration.root() / "vehicle", own)
    profile = load_profile("s500")
    vehicle = replace(load_description(), model=own / "s500_arm.xml")
    expected = Vehicle.of(vehicle).compile(0.1)
    found = carried("hover", replace(profile, vehicle=vehicle))
    assert found.model == "s500_arm.xml" and "parts/s500_frame.xml" in found.files
    shutil.rmtree(own)
    there = arrived(found, profile).vehicle
    assert not there.model.is_relative_to(own)
    assert Vehicle.of(there).compile(0.1).body_mass == pytest.approx(expected.body_mass)
    assert arrived(found, profile).vehicle.model == there.model  # once in a process


def test_a_gripper_of_the_user_travels_too(tmp_path):
    own = tmp_path / "own"
    shutil.copytree(configuration.root() / "grippers", own)
    file = tmp_path / "mine.yaml"
    file.write_text(f"derives: s500_gripper\ngripper: {{type: {own / 'two_finger.yaml'}}}\n")
    profile = replace(load_profile("s500"), vehicle=load_description(file))
    found = carried("hover", profile)
    shutil.rmtree(own)
    there = Vehicle.of(arrived(found, profile).vehicle).compile(0.0)
    assert there.joint("gripper_left").range == pytest.approx([0.01, 0.0375])


def test_a_scenario_file_travels_as_it_was_read(tmp_path):
    file = Path(shutil.copy(configuration.root() / "scenarios/hover.yaml", tmp_path / "mine.yaml"))
    profile = load_profile("s500")
    trial = Trial("x", profile, 0.0, 1, str(file))
    expected = trial.flown_scenario
    trial = replace(trial, carried=carried(trial.scenario, profile))
    file.unlink()
    assert trial.flown_scenario.landing == expected.landing
