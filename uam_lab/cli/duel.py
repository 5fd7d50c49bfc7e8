"""`uam duel`: laws over another laboratory's tasks, beside its published figures.

Fly every row of a duel over its tasks on its plant; write the errors of end effector, platform and
heading beside the published ones, standing offset and survived delay.

examples:
  uam duel                              every row, three seeds: some 400 flights
  uam duel --seeds 1 --rows "default, hand"
  uam duel pillars                      pick-and-place, 20 seeds
  uam duel mine.yaml --out mine         a file as config/duel/fsc_lab.yaml; a stopped duel continues

Results in --out: tables.md, flights.parquet. Deviations from the published tasks: docs/duel.md.
"""

import argparse

from uam_control.settings.atomic import write_text
from uam_lab.cli.command import Command, count, place_of
from uam_lab.flights.conclude import command_line
from uam_lab.records.results.result_folder import make_folder
from uam_lab.records.results.terminal import say


def add(command: Command) -> None:
    text = "a duel of config/duel, or a file"
    command.option("name", "NAME|FILE", text, "fsc_lab", nargs="?")
    command.option("--seeds", "N", "seeds 1..N (default: the duel's)", type=count)
    command.option("--rows", "LABEL", "rows that fly (default: all)", nargs="+")
    command.workers()
    command.out()


def run(options: argparse.Namespace) -> int:
    from uam_lab.experiments.duel import flights
    from uam_lab.experiments.duel.flights import ROWS, load_duel, measure, trials
    from uam_lab.experiments.trials.carried import inputs
    from uam_lab.experiments.trials.experiment import TABLE, Experiment

    duel = load_duel(options.name, tuple(options.rows or ()))
    seeds = options.seeds or duel.seeds
    planned = list(trials(duel, seeds))
    profiles = [(label, one.sets, one.bridge()) for label, one in duel.rows.items()]
    given = {"profiles": profiles, "plant": duel.plant, "scenarios": duel.scenarios, "seeds": seeds}
    out = make_folder(options.out, "duel")
    known = inputs(duel.vehicle, duel.scenarios[0], given)
    experiment = Experiment("duel", out / TABLE, ROWS, known, place_of(options), measure)
    text = flights.tables(duel, experiment.fly_all(planned, _about))
    write_text(out / "tables.md", f"{text}\nMade by `{command_line()}`.\n")
    say(text)
    say(f"results  {out}")
    return 0


def _about(result: object) -> str:
    return f"{result.row}, {result.scenario}, seed {result.seed}"
