"""docs/preflight.md has every item, step and limit of the checklist."""

import re
from pathlib import Path

import numpy as np

from uam_lab.flights.vehicle.checklist_parameters import (
    ChecklistOptions,
    ChecklistParameters,
    MotionLimits,
)
from uam_lab.preflight.checklist.automatic import automatic
from uam_lab.preflight.checklist.guided import JOINT, guided
from uam_lab.preflight.checklist.observation import Box, Observation

TEXT = (Path(__file__).resolve().parents[2] / "docs/preflight.md").read_text()


def rows(name):
    part = re.search(rf"<!-- {name} -->\n(.*?)<!-- end -->", TEXT, re.S)[1]
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in part.splitlines()[2:]]


def test_the_automatic_items_are_those_of_the_page_in_order():
    box = Box((0.0,) * 3, (1.0,) * 3)
    seen = Observation(("arm_driver",), (), np.zeros(0), 250.0, killed=True, fence=box, room=box)
    found = automatic(seen, ChecklistParameters())
    assert [row[0] for row in rows("automatic")] == [one.name for one in found]
    standing = [row[0] for row in rows("automatic") if row[1].endswith("standing")]
    assert standing == [one.name for one in found if one.standing]


def test_the_guided_steps_are_those_of_the_page_in_order():
    named = [name for row in rows("guided") for name in re.findall(r"`([\w:]+)`", row[0])]
    found = [one.name for one in guided(("NAME",), ChecklistParameters())]
    assert JOINT + "NAME" in found
    assert named == found


def test_every_limit_is_named():
    named = set(re.findall(r"`(\w+)`", TEXT))
    known = set(ChecklistParameters.specs()) | set(ChecklistOptions.specs())
    assert known <= named | {"record"}
    in_tables = {name for row in rows("automatic") for name in re.findall(r"`(\w+)`", row[2])}
    assert set(ChecklistParameters.specs()) - set(MotionLimits.specs()) <= in_tables
