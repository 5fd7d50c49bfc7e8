"""`uam faults`: fly every fault at every moment of the mission and classify the outcome."""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path

from uam_control.mission import ScenarioError, load_scenario
from uam_control.profiles.profile import ProfileError
from uam_control.settings import configuration
from uam_control.settings.configuration import ConfigurationError
from uam_control.vehicle import VehicleError, load_description
from uam_lab.campaign.pool import cores, fly_all
from uam_lab.cli.counting import Counting
from uam_lab.cli.vehicle_options import add_profile, add_vehicle, given_profile
from uam_lab.flight import settings as flight_settings
from uam_lab.flight.settings import CLOCKS, ENGINES, SettingsError
from uam_lab.results.result_folder import ResultFolderError, make_folder
from uam_sim_bridge.faults import FaultError, fault_catalogue, limits
from uam_sim_bridge.ports import PortError

BROKEN, WRONG_USE = 1, 2
EXAMPLES = """\
examples:
  uam faults                                 the matrix of config/campaign/faults.yaml
  uam faults --list                          list all faults, with parameters and ranges
  uam faults --only motor_loss --moment transit
  uam faults --matrix mine.yaml --profile asmc2
  uam faults --only motor_loss --vehicle mine.yaml
  uam faults --matrix processes --engine ros --clock realtime --repeat 3
  uam fly --fault motor_loss@pick+1:remaining=0.7      one flight with its report

Results in --out: report.html with the matrix in colours, summary.md, flights.csv, faults.json,
matrix.png. The same seed gives the same flights, except with process faults. Exit status: 0 all
promises of the matrix kept, 1 a promise broken, 2 wrong use.
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the subcommand to the command line."""
    parser = commands.add_parser(
        "faults",
        help="faults at every moment of the mission, with their outcomes",
        description="Fly the mission once for each fault and moment, and classify the outcome.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    option = parser.add_argument
    option("--list", action="store_true", help="list the faults; do not fly")
    option(
        "--matrix",
        default="faults",
        metavar="NAME|FILE",
        help="faults and moments, as config/campaign/faults.yaml (default %(default)s)",
    )
    option(
        "--only",
        action="append",
        default=[],
        metavar="FAULT",
        help="only this fault of the matrix; may be repeated",
    )
    option(
        "--moment",
        action="append",
        default=[],
        metavar="NAME",
        help="only this moment of the matrix; may be repeated",
    )
    option("--scenario", metavar="NAME|FILE", help="default: that of the matrix")
    add_vehicle(parser)
    add_profile(parser)
    option("--engine", default="direct", metavar="ros|direct", help="(default %(default)s)")
    option(
        "--clock",
        default="lockstep",
        metavar="lockstep|realtime",
        help="of the ROS engine (default %(default)s)",
    )
    option("--seed", type=int, default=1, metavar="N", help="of all noise (default %(default)s)")
    option(
        "--jobs",
        type=int,
        metavar="N",
        help=f"parallel flights (default: one per core, {cores()}; with --engine ros 1)",
    )
    option(
        "--repeat",
        type=int,
        default=1,
        metavar="N",
        help="flights per fault and moment (default %(default)s)",
    )
    option("--out", type=Path, metavar="DIR", help="result folder (default results/<time>-faults)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    if options.list:
        print(fault_catalogue.listing())
        return 0
    try:
        return campaign(options)
    except (
        ConfigurationError,
        ProfileError,
        ScenarioError,
        VehicleError,
        FaultError,
        SettingsError,
        PortError,
        ResultFolderError,
        OSError,
    ) as error:
        print(f"uam faults: {error}", file=sys.stderr)
        return WRONG_USE


def campaign(options: argparse.Namespace) -> int:
    """Check, fly, then write the results; return the exit status."""
    from uam_lab.campaign import fault_matrix, fault_report, fault_trial

    _check(options)
    vehicle = load_description(options.vehicle)
    profile = given_profile(options.profile, vehicle)
    file = configuration.named("campaign", options.matrix)
    given = (options.engine, options.only, options.moment, options.scenario)
    matrix = fault_matrix.read(file, *given, vehicle)
    mass = load_scenario(matrix.scenario, vehicle).payload_mass
    cells = matrix.cells(options.seed, options.repeat)
    for cell in cells:
        limits.check(cell.schedule, options.engine, vehicle=vehicle)
    trials = [
        fault_trial.FaultTrial(
            cell, matrix.scenario, profile, mass, options.seed, options.engine, options.clock
        )
        for cell in cells
    ]
    out = make_folder(options.out, "faults")
    jobs = options.jobs or (1 if options.engine == "ros" else cores())
    with Counting("faults", len(trials)) as counting:

        def show(done: int, one: fault_trial.FaultResult) -> None:
            moment = f", {one.moment}" if one.moment else ""
            counting.show(done, f"{one.fault}{moment}: {one.outcome}")

        results = fly_all(trials, jobs, fault_trial.fly, show)
    command = shlex.join(["uam", *sys.argv[1:]])
    summary, page = fault_report.write(out, matrix, results, vehicle.name, command)
    print(summary)
    print(f"report   {page}")
    return BROKEN if any(result.kept is False for result in results) else 0


def _check(options: argparse.Namespace) -> None:
    if options.seed < 0 or options.repeat < 1 or (options.jobs is not None and options.jobs < 1):
        raise SettingsError("--jobs and --repeat must be 1 or more, --seed 0 or more")
    for name, value, allowed in (
        ("engine", options.engine, ENGINES),
        ("clock", options.clock, CLOCKS),
    ):
        if value not in allowed:
            raise SettingsError(f"unknown {name} '{value}'; there are: {', '.join(allowed)}")
    if options.engine == "direct" and options.clock == "realtime":
        raise SettingsError("the direct engine has no clock: --clock realtime needs --engine ros")
    if options.engine == "ros":
        flight_settings.require_ros()
