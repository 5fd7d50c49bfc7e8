"""docs/plant.md agrees with the code."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from uam_lab.cli.parser import parser
from uam_sim_bridge.plant.effects import presets

TEXT = (Path(__file__).resolve().parents[2] / "docs/plant.md").read_text()


def test_the_table_is_that_of_the_code():
    assert presets.table() in TEXT, "run: python docs/make_plant.py"


def test_the_examples_can_be_typed():
    lines = re.findall(r"^\.venv/bin/uam (.*?)(?: {2,}#.*)?$", TEXT, re.M)
    assert len(lines) == 5
    for options in (vars(parser().parse_args(shlex.split(line))) for line in lines):
        named = [name for name in options["plant_preset"] if not name.endswith(".yaml")]
        assert presets.read(named, options["effects"])
