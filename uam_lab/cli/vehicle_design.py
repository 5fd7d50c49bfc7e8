"""`uam vehicle design`: gains of the autopilot and a profile from the vehicle's numbers.

Design the gains of the autopilot and the flying profile of a vehicle from its file, with stated
margins, and say what limits each loop.

examples:
  uam vehicle design my/quad.yaml            profile, autopilot and pictures beside my/quad.yaml
  uam vehicle design my/quad.yaml --out mine in the folder mine
  uam vehicle design my/quad.yaml --criteria my/margins.yaml      other margins, see docs/tuning.md

A vehicle whose file names neither profiles nor autopilot flies with the design beside it:
uam fly --vehicle my/quad.yaml. The margins are those of uam margins. Exit status: 0 designed,
2 wrong use, or no gains keep the margins.
"""

import argparse

from uam_control.settings import configuration
from uam_control.vehicle import AUTOPILOT_FILE, PROFILE_FILE, load_description
from uam_lab.cli.command import Command, path
from uam_lab.records.results.result_folder import make_folder
from uam_lab.records.results.terminal import say


def add(command: Command) -> None:
    vehicles = ", ".join(configuration.names("vehicle", (".yaml",)))
    command.option("name", "NAME|FILE", f"{vehicles}, or the description of a vehicle")
    text = "entries in place of those of config/design/criteria.yaml"
    command.option("--criteria", "FILE", text, type=path)
    text = "folder of the files (default: that of the vehicle's file; a folder of results for NAME)"
    command.option("--out", "DIR", text, type=path)


def run(options: argparse.Namespace) -> int:
    from uam_lab.experiments.design import search
    from uam_lab.experiments.design.criteria import load_criteria

    described = load_description(options.name)
    criteria = load_criteria(options.criteria)
    folder, shipped = options.out, described.source == described.name
    if folder is not None or shipped:
        folder = make_folder(folder, "design")
    written = search.files_of(described, folder or described.file.parent)
    made = search.design(described, criteria, say)
    search.write(made, written)
    say(search.table(made))
    for file in written.values():
        say(f"written  {file}")
    numbers = load_description(options.name).numbers  # one that derives has its own design now
    if folder is not None or "profiles" in numbers or "autopilot" in numbers:
        say(
            f"{described.file.name} flies with these gains after: profiles: {{modular: "
            f"{written[PROFILE_FILE].absolute()}}}, autopilot: {written[AUTOPILOT_FILE].absolute()}"
        )
    return 0
