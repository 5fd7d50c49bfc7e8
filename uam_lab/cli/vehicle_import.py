"""`uam vehicle import`: a vehicle from its URDF or MJCF.

Find base, arm, end effector, rotors and feet of a URDF or MJCF, ask for what it cannot hold, and
write the files of a vehicle.

examples:
  uam vehicle import drone.urdf                          writes drone/: drone.yaml, drone.xml ...
  uam vehicle import drone.urdf --out my --set rotors.thrust_max=8.2 --set servo=XM430-W350
  uam vehicle import drone.urdf --answers answers.yaml   the same from a file
  uam vehicle import iris.urdf --arm-of %s         a drone without an arm gets one
  uam vehicle design drone/drone.yaml                    then: gains and profile
  uam fly --vehicle drone/drone.yaml --scenario hover --engine direct

What a description cannot hold is asked at the terminal, taken from --answers and --set, or assumed;
the YAML file has the origin of each number, drone.txt the list of what is missing. Keys:
%s
Servos: %s.
docs/your_vehicle.md. Exit status: 0 written, 2 wrong use or a description that is refused, by file
and line.
"""

import argparse
import re
import sys
from pathlib import Path
from typing import Any

from uam_control.vehicle import DEFAULT_VEHICLE, load_description
from uam_lab.cli.command import Command, path
from uam_lab.records.results.terminal import say


def page(_: str) -> str:
    """Return the docstring of this module with the keys of the answers, and the servos."""
    from uam_lab.importing.answers import Answers
    from uam_lab.importing.numbers import servo_types

    questions = Answers().assumed.mapping("questions")
    keys = "\n".join(f"  {key:22} {what} [{unit}]" for key, (what, unit) in questions.items())
    return __doc__ % (DEFAULT_VEHICLE, keys, ", ".join(servo_types()))


def add(command: Command) -> None:
    command.option("file", "FILE", "URDF or MJCF; meshes are found beside it", type=path)
    command.option("--out", "DIR", "folder of the files (default ./NAME)", type=path)
    command.option("--name", "NAME", "of the vehicle (default: that of the file)", "")
    command.option("--answers", "FILE", "answers in YAML, by the keys below", type=path)
    command.repeated("--set", "KEY=VALUE", "one answer", dest="answer")
    command.option("--base", "BODY", "body that flies, where several may", "")
    command.option("--arm", "JOINT", "first joint of the arm, where several hang on the base", "")
    text = "body or site of the last link (default: tool0, gripper .., else the far end)"
    command.option("--end-effector", "NAME", text, "")
    text = "vehicle whose arm hangs below a base without an arm"
    command.option("--arm-of", "NAME|FILE", text, "")
    text = "hang no magnet of 0.07 kg at the end effector: nothing is picked"
    command.switch("--no-magnet", text)
    command.switch("--no-questions", "assume what is not answered; the usual without a terminal")
    command.switch("--overwrite", "write into a folder that has such a vehicle")


def run(options: argparse.Namespace) -> int:
    from uam_lab.importing import importer, picture
    from uam_lab.importing.answers import Answers, read_answers
    from uam_lab.importing.source import ImportRefused
    from uam_lab.importing.structure import Chosen

    name = options.name or importer.usual_name(options.file)
    if not re.fullmatch(r"[\w.-]+", name):
        raise ImportRefused(f"--name: {name!r}: letters, digits, '_', '-' and '.' expected")
    folder = options.out or Path(name)
    written = folder / f"{name}.yaml"
    if written.exists() and not options.overwrite:
        raise ImportRefused(f"{written} exists; --overwrite, or another --out or --name")
    asked = sys.stdin.isatty() and options.questions
    answers = Answers(read_answers(options.answers, options.answer), _ask if asked else None)
    arm_of = load_description(options.arm_of) if options.arm_of else None
    chosen = Chosen(options.base, options.arm, options.end_effector, options.magnet)
    made = importer.import_vehicle(options.file, folder, name, chosen, answers, arm_of)
    say("found:")
    for line in made.found:
        say(f"  {line}")
    say("missing or assumed:")
    for line in made.missing:
        say(f"  {line}")
    if why := picture.draw(written, folder / f"{name}.png"):
        say(f"  no picture: {why}")
    say(f"written  {folder}: {name}.yaml, {name}.xml, {name}.txt, {name}.png")
    say(f"next     uam vehicle design {written}")
    say(f"         uam fly --vehicle {written} --scenario hover --engine direct")
    return 0


def _ask(what: str, unit: str, usual: Any) -> str:
    """Return the answer of the user, "" to assume the usual value."""
    say(f"{what} [{unit}] (empty: {usual}): ", end="")
    return sys.stdin.readline().strip()
