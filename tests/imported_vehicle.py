"""A vehicle that is imported from a text, and what is looked at of it."""

from __future__ import annotations

import mujoco

from uam_lab.importing import importer
from uam_lab.importing.answers import Answers
from uam_lab.importing.structure import Chosen
from uam_sim_bridge.plant import Vehicle


def write(folder, text, name="mine.urdf"):
    file = folder / name
    file.write_text(text)
    return file


def imported(folder, text, name="mine.urdf", chosen=None, answers=None, arm_of=None):
    file = write(folder, text, name)
    made = importer.import_vehicle(
        file, folder / "out", "mine", chosen or Chosen(), answers or Answers(), arm_of
    )
    return made, Vehicle.of(made.description).compile(0.0)


def posed(model, names, angles):
    data = mujoco.MjData(model)
    for name, angle in zip(names, angles, strict=True):
        data.joint(name).qpos = angle
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


def line_of(text, part):
    return text[: text.index(part)].count("\n") + 1
