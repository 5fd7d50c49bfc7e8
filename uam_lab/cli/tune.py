"""`uam tune`: search a controller's parameters over whole flights.

Search a controller's parameters over whole flights of the direct engine, with several payloads and
seeds: for the least cost, or for least cost and largest delay margin.

examples:
  uam tune                                   the modular law, 200 evaluations
  uam tune --controller asmc1 --evaluations 100
  uam tune --out results/tune-mine           continue a stopped search
  uam tune --space mine.yaml --profile best.yaml
  uam tune --controller late_links --evaluations 300     cost and delay margin, with their front
  uam tune --evaluations 2000 --patience 300     until 300 evaluations improve it by less than 1 %
  uam tune --vehicle mine.yaml
  uam tune --study arm --storage mysql://user@host/optuna    on several machines with one study:
                                             the same command on each

A space (config/tuning) defines the parameters with their ranges, the flights of an evaluation, and
the cost. Results in --out: best.yaml (for uam fly --profile), search.png, evaluations.csv,
study.journal.
"""

import argparse
import shlex
import signal

from uam_control.laws import catalogue
from uam_control.settings import configuration
from uam_control.vehicle import load_description
from uam_lab.cli.command import Command, chosen_effects, count, given_profile, place_of
from uam_lab.experiments.trials.counting import Counting
from uam_lab.experiments.tuning.front import LEAST, SMALL, convergence
from uam_lab.experiments.tuning.space import TuningError, load_space
from uam_lab.flights.conclude import command_line
from uam_lab.flights.direct.warm_up import prepare
from uam_lab.flights.processes.interrupts import INTERRUPTED
from uam_lab.records.results.result_folder import make_folder
from uam_lab.records.results.terminal import say


def add(command: Command) -> None:
    text = f"space of config/tuning: {', '.join(configuration.names('tuning'))}"
    command.option("--controller", "NAME", text, catalogue.DEFAULT)
    command.option("--space", "FILE", "file with another space")
    command.vehicle()
    text = "start of the search, a later one overrides (default: the vehicle's for the controller)"
    command.repeated("--profile", "NAME|FILE", text)
    command.plant()
    text = "total number of evaluations of the study"
    command.option("--evaluations", "N", text, 200, type=count)
    text = (
        "end before, when N evaluations in a row improved the least cost, or the front's area, "
        f"by less than {SMALL:.0%}% (default: all evaluations)"
    )
    command.option("--patience", "N", text, type=count)
    command.workers()
    command.seed("of the optimiser; with --jobs 1 the search is repeatable")
    text = (
        "initial step around the start, as a fraction of the logarithmic range; "
        "use a smaller one for a good start"
    )
    command.option("--step", "SHARE", text, 0.1, type=float)
    command.out("tune-<controller>; that of a stopped search continues it")
    text = "storage of the study: a journal file, or a database URL of Optuna "
    command.option("--storage", "FILE|URL", text + "(default <out>/study.journal)")
    command.option("--study", "NAME", "name in the storage (default: that of the space)")


def run(options: argparse.Namespace) -> int:
    from uam_lab.experiments.tuning import search_results
    from uam_lab.experiments.tuning.search import (
        DONE,
        Task,
        curve,
        evaluated_start,
        open_study,
        refuse_other_study,
        search,
    )

    vehicle = load_description(options.vehicle)
    start = given_profile(options.profile, vehicle) if options.profile else None
    space = load_space(options.space or options.controller, start, vehicle)
    space = space.with_effects(chosen_effects(options))
    if not 0.0 < options.step <= 0.5:  # before a folder is made
        raise TuningError(f"--step {options.step:g} is outside 0 to 0.5")
    out = make_folder(options.out, "tune", space.name, shared=options.storage is not None)
    place = place_of(options)
    if place.scheduler and not options.storage:
        say("uam tune: with --scheduler the workers need to reach --storage", error=True)
    storage = options.storage or str((out / "study.journal").resolve())
    task = Task(
        space,
        options.study or space.name,
        storage,
        options.evaluations,
        options.seed,
        options.step,
        options.patience or 0,
    )
    if options.storage is None:
        refuse_other_study(task)
    prepare(print)
    status = 0
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C
    try:
        with Counting("tune", options.evaluations) as counting:

            def show(done: int, best: float | None) -> None:
                text = "best cost" if space.delay_margin is None else "area of the front [ms]"
                counting.show(done, "" if best is None else f"{text} {best:.4g}")

            search(task, place, show)
    except KeyboardInterrupt:
        status = INTERRUPTED
        say(
            "uam tune: interrupted; the same command continues the search"
            if options.out
            else f"uam tune: interrupted; --out {out} continues the search",
            error=True,
        )
    study = open_study(task)
    if not study.get_trials(deepcopy=False, states=DONE):
        return status or 1
    search_results.write_best(out / "best.yaml", space, study, command_line())
    search_results.write_evaluations(out / "evaluations.csv", space, study)
    search_results.plot(out / "search.png", space, study)
    best, told = search_results.best_of(space, study), search_results.in_words
    begun = told(evaluated_start(space, study))
    say(f"best      evaluation {best.number}, {told(best)}; start: {begun}")
    if space.delay_margin is not None and best.values[1] < space.delay_margin:
        say(f"margin    none found has {1e3 * space.delay_margin:g} ms: the best has the largest")
    values = curve(study)
    say(f"search    {convergence(values, options.patience or max(LEAST, len(values) // 2))}")
    law = next(iter(space.start.laws().values()))
    flown = ["uam", "fly", "--vehicle", str(options.vehicle), "--controller", law, "--profile"]
    say(f"profile   {out / 'best.yaml'}   ({shlex.join([*flown, str(out / 'best.yaml')])})")
    say(f"plot      {out / 'search.png'}")
    return status
