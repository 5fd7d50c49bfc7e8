"""`uam tune`: searches a controller's parameters over whole flights."""

from __future__ import annotations

import argparse
import shlex
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from uam_control.laws import catalogue
from uam_control.mission import ScenarioError
from uam_control.profiles.profile import ProfileError
from uam_control.settings import configuration
from uam_control.settings.configuration import ConfigurationError
from uam_control.vehicle import VehicleError, load_description
from uam_lab.campaign.pool import cores
from uam_lab.cli.counting import Counting
from uam_lab.cli.vehicle_options import add_vehicle, given_profile
from uam_lab.flight.direct.warm_up import is_cold, warm_up
from uam_lab.results.result_folder import ResultFolderError, make_folder

if TYPE_CHECKING:
    from uam_lab.tuning.space import Space

INTERRUPTED, WRONG_USE = 130, 2
EXAMPLES = """\
examples:
  uam tune                                   the modular law, 200 evaluations
  uam tune --controller asmc1 --evaluations 100
  uam tune --out results/tune-mine           continue a stopped search
  uam tune --space mine.yaml --profile best.yaml
  uam tune --vehicle mine.yaml
  uam tune --study arm --storage mysql://user@host/optuna    on several machines with one study:
                                             the same command on each

A space (config/tuning) defines the parameters with their ranges, the flights of an evaluation, and
the cost. Results in --out: best.yaml (for uam fly --profile), search.png, evaluations.csv,
study.journal.
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the subcommand to the command line."""
    parser = commands.add_parser(
        "tune",
        help="search a controller's parameters over whole flights",
        description="Search a controller's parameters with CMA-ES over whole flights of the direct "
        "engine, with several payloads and seeds.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    option = parser.add_argument
    option(
        "--controller",
        default=catalogue.DEFAULT,
        metavar="NAME",
        help="space of config/tuning: "
        + ", ".join(configuration.names("tuning"))
        + " (default %(default)s)",
    )
    option("--space", metavar="FILE", help="file with another space")
    add_vehicle(parser)
    option(
        "--profile",
        metavar="NAME|FILE",
        help="start of the search (default: the vehicle's profile for the controller)",
    )
    option(
        "--evaluations",
        type=_count,
        default=200,
        metavar="N",
        help="total number of evaluations of the study (default %(default)s)",
    )
    option(
        "--jobs",
        type=_count,
        default=cores(),
        metavar="N",
        help="processes (default: one per core, %(default)s)",
    )
    option(
        "--seed",
        type=int,
        default=1,
        metavar="N",
        help="of the optimiser; with --jobs 1 the search is repeatable (default %(default)s)",
    )
    option(
        "--step",
        type=float,
        default=0.1,
        metavar="SHARE",
        help="initial step around the start, as a fraction of the logarithmic range; "
        "use a smaller one for a good start (default %(default)s)",
    )
    option(
        "--out",
        type=Path,
        metavar="DIR",
        help="result folder; that of a stopped search continues it (default "
        "results/<time>-tune-<controller>)",
    )
    option(
        "--storage",
        metavar="FILE|URL",
        help="storage of the study: a journal file, or a database URL of Optuna "
        "(default <out>/study.journal)",
    )
    option("--study", metavar="NAME", help="name in the storage (default: that of the space)")
    parser.set_defaults(run=run)


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of 1 or more")
    return int(text)


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    from uam_lab.tuning.space import TuningError, load_space

    try:
        vehicle = load_description(options.vehicle)
        start = given_profile(options.profile, vehicle) if options.profile else None
        space = load_space(options.space or options.controller, start, vehicle)
        return tune(options, space)
    except (
        TuningError,
        ProfileError,
        ScenarioError,
        ConfigurationError,
        VehicleError,
        ResultFolderError,
        OSError,
    ) as error:
        print(f"uam tune: {error}", file=sys.stderr)
        return WRONG_USE


def tune(options: argparse.Namespace, space: Space) -> int:
    """Search, show the progress, write the results; return the exit status."""
    from uam_lab.tuning import search_results
    from uam_lab.tuning.search import Task, open_study, search
    from uam_lab.tuning.space import TuningError

    if not 0.0 < options.step <= 0.5:  # before a folder is made
        raise TuningError(f"--step {options.step:g} is outside 0 to 0.5")
    out = make_folder(options.out, "tune", space.name)
    storage = options.storage or str(out / "study.journal")
    task = Task(
        space, options.study or space.name, storage, options.evaluations, options.seed, options.step
    )
    if is_cold():
        print("compiling the control path (once)")
        warm_up()
    status = 0
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C
    try:
        with Counting("tune", options.evaluations) as counting:

            def show(done: int, best: float | None) -> None:
                counting.show(done, "" if best is None else f"best cost {best:.4g}")

            search(task, options.jobs, show)
    except KeyboardInterrupt:
        status = INTERRUPTED
        print(
            "uam tune: interrupted; the same command continues the search"
            if options.out
            else f"uam tune: interrupted; --out {out} continues the search",
            file=sys.stderr,
        )
    study = open_study(task)
    if not any(trial.value is not None for trial in study.trials):
        return status or 1
    command = shlex.join(["uam", *sys.argv[1:]])
    search_results.write_best(out / "best.yaml", space, study, command)
    search_results.write_evaluations(out / "evaluations.csv", space, study)
    search_results.plot(out / "search.png", space, study)
    best = study.best_trial
    print(
        f"best      evaluation {best.number}, cost {best.value:.4g}; start "
        f"{study.trials[0].value:.4g}"
    )
    print(f"profile   {out / 'best.yaml'}   (uam fly --profile {out / 'best.yaml'})")
    print(f"plot      {out / 'search.png'}")
    return status
