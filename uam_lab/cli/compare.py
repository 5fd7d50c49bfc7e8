"""`uam compare`: the paper's tables and figures, all controllers over the same flights."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from uam_control.laws import catalogue
from uam_control.mission import ScenarioError, load_scenario
from uam_control.profiles.profile import ProfileError, default_profile, load_profile
from uam_control.settings import configuration
from uam_control.settings.configuration import ConfigurationError
from uam_control.vehicle import VehicleDescription, VehicleError, load_description
from uam_lab.campaign.pool import cores, figures_of, fly_all
from uam_lab.campaign.trial import TrialResult
from uam_lab.cli.counting import Counting
from uam_lab.cli.vehicle_options import add_scenario, add_vehicle
from uam_lab.compare import plan
from uam_lab.flight.settings import ENGINES, SettingsError, require_ros
from uam_lab.results.result_folder import ResultFolderError, make_folder

WRONG_USE = 2
EXAMPLES = """\
examples:
  uam compare                          every controller, payloads 0.1 0.2 0.3 kg, 5 seeds
  uam compare --seeds 10 --jobs 4
  uam compare --engine ros --rows proposed --seeds 10    with the nodes, one flight at a time
  uam compare --profile mine=mine.yaml     with one more row, for the profile mine.yaml
  uam compare --vehicle mine.yaml --scenario hover --rows proposed frozen

Results in --out: report.html, tables.md, flights.csv, comparison.json, figures/. The baselines are
reconstructions (docs/law.md). The same command gives the same tables.
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the subcommand to the command line."""
    parser = commands.add_parser(
        "compare",
        help="all controllers over the same flights: the paper's tables and figures",
        description="Fly every controller over the same payloads and seeds; write the paper's "
        "three tables and five figures.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_vehicle(parser)
    add_scenario(parser)
    option = parser.add_argument
    option("--seeds", type=int, default=5, metavar="N", help="seeds 1..N (default %(default)s)")
    option(
        "--payload-mass", type=float, nargs="+", metavar="KG", help="payloads (default 0.1 0.2 0.3)"
    )
    option(
        "--engine",
        choices=ENGINES,
        default="direct",
        help="nodes and sockets, or one loop without them (default %(default)s)",
    )
    option(
        "--rows",
        nargs="+",
        metavar="NAME",
        choices=tuple(plan.ROWS),
        default=tuple(plan.ROWS),
        help=f"rows of the tables: {', '.join(plan.ROWS)} (default: all)",
    )
    option(
        "--profile",
        action="append",
        default=[],
        metavar="LABEL=FILE",
        help="an additional row; may be repeated",
    )
    option(
        "--jobs",
        type=int,
        metavar="N",
        help=f"parallel flights (default: one per core, {cores()}; with --engine ros 1)",
    )
    option("--out", type=Path, metavar="DIR", help="result folder (default results/<time>-compare)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    try:
        jobs = options.jobs
        if jobs is None:
            jobs = 1 if options.engine == "ros" else cores()
        if options.seeds < 1 or jobs < 1:
            raise ConfigurationError("--seeds and --jobs must be 1 or more")
        payloads = tuple(options.payload_mass or plan.PAYLOADS)
        if not all(0.0 <= mass <= 2.0 for mass in payloads):
            raise ConfigurationError("--payload-mass must be 0 to 2 kg")
        vehicle = load_description(options.vehicle)
        load_scenario(options.scenario, vehicle)  # an invalid one is refused before any flight
        rows = (
            *plan.entries(options.rows, vehicle),
            *(_further(text, vehicle) for text in options.profile),
        )
        out = make_folder(options.out, "compare")
        (out / "flights").mkdir(exist_ok=True)
        seeds = range(1, options.seeds + 1)
        flights = plan.Flights(vehicle, options.scenario, payloads, tuple(seeds))
        return compare(rows, flights, options.engine, jobs, out)
    except (
        ConfigurationError,
        ProfileError,
        ResultFolderError,
        ScenarioError,
        SettingsError,
        VehicleError,
        OSError,
    ) as error:
        print(f"uam compare: {error}", file=sys.stderr)
        return WRONG_USE


def _further(text: str, vehicle: VehicleDescription) -> plan.ComparedController:
    label, _, file = text.partition("=")
    if not label or not file:
        raise ConfigurationError(f"--profile {text}: LABEL=FILE is expected")
    profile = load_profile(str(configuration.named("profiles", file)), vehicle=vehicle)
    return plan.ComparedController(label, profile)


def compare(
    rows: Sequence[plan.ComparedController],
    flights: plan.Flights,
    engine: str,
    jobs: int,
    out: Path,
) -> int:
    """Fly, then write the results; return the exit status."""
    from uam_lab.compare import comparison_report, modularity

    trials = plan.trials(rows, flights, out / "flights")
    proposed = default_profile(catalogue.DEFAULT, flights.vehicle)
    kept = out / "flights" / "modularity.parquet"
    extra = modularity.trials(proposed, flights, kept)
    with Counting("compare", len(trials) + len(extra)) as counting:

        def show(done: int, result: TrialResult) -> None:
            counting.show(done, f"{result.label}, {result.payload_mass:g} kg, seed {result.seed}")

        results = fly_all(trials, jobs, _work(engine), progress=show)
        # direct engine: these flights compare the laws only, which are the same in both engines
        others = fly_all(
            extra, jobs, progress=lambda done, result: show(len(trials) + done, result)
        )
    modular = modularity.Evidence.of(proposed, kept, others)
    facts = {
        "command": shlex.join(["uam", *sys.argv[1:]]),
        "engine": engine,
        "vehicle": flights.vehicle.name,
        "scenario": flights.scenario,
        "payloads_kg": list(flights.payloads),
        "seeds": list(flights.seeds),
        "profiles": {row.label: row.profile.file.name for row in rows},
        "budgets": comparison_report.budgets(rows),
    }
    written = comparison_report.write(out, trials, results, modular, facts)
    print(written.text)
    print(f"vehicle  {flights.vehicle.name}\nresults  {out}\nreport   {written.page}")
    return 0


def _work(engine: str):
    """Return the function that flies a trial. Raises SettingsError if ROS is not installed."""
    if engine == "direct":
        return figures_of
    require_ros()
    from uam_lab.campaign.ros_trial import fly

    return fly
