"""docs/faults.md agrees with the code."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from uam_control.mission import load_scenario
from uam_lab.cli.parser import parser
from uam_lab.experiments.trials.outcome import OUTCOMES
from uam_sim_bridge.faults import FAULTS, fault_catalogue, read_schedule

TEXT = (Path(__file__).resolve().parents[2] / "docs/faults.md").read_text()


def test_the_outcomes_are_those_of_the_code():
    assert "".join(f"| {name} | {about} |\n" for name, about in OUTCOMES.items()) in TEXT


def test_the_examples_can_be_typed():
    lines = re.findall(r"^\.venv/bin/uam (.*?)(?: {2,}#.*)?$", TEXT, re.M)
    options = [vars(parser().parse_args(shlex.split(line))).get("faults") or [] for line in lines]
    texts = [text for found in options for text in found if not text.endswith(".yaml")]
    assert len(lines) == 11 and len(texts) == 3
    read_schedule(texts, load_scenario("pick_and_place"), 1)


def test_every_fault_is_listed_for_the_terminal():
    listing = fault_catalogue.listing()
    for name, kind in FAULTS.items():
        assert name in listing and all(f" {parameter}: " in listing for parameter in kind.specs())
