"""`uam campaign`: many random flights around the nominal one."""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path

from uam_control.mission import ScenarioError, load_scenario
from uam_control.profiles.profile import Profile, ProfileError
from uam_control.settings.configuration import ConfigurationError
from uam_control.vehicle import VehicleError, load_description
from uam_lab.campaign.pool import cores, fly_all
from uam_lab.campaign.trial import TrialResult
from uam_lab.cli.counting import Counting
from uam_lab.cli.vehicle_options import add_profile, add_scenario, add_vehicle, given_profile
from uam_lab.results.result_folder import ResultFolderError, make_folder

WRONG_USE = 2
EXAMPLES = """\
examples:
  uam campaign                             1,000 flights of the flying profile
  uam campaign --flights 100 --profile asmc2
  uam campaign --flights 100 --vehicle mine.yaml
  uam campaign --out robust                stop with Ctrl-C; the same command continues

Mass and position of the payload, wind, gusts, sensor noise, masses, inertias and motors are drawn
from the ranges of config/campaign/robustness.yaml. Results in --out: summary.md, flights.csv,
campaign.json, campaign.png. The same seed gives the same flights; more --flights only add some.
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the subcommand to the command line."""
    parser = commands.add_parser(
        "campaign",
        help="many random flights: success rate, errors, conditions of the losses",
        description="Fly the mission many times in the direct engine, each with another payload, "
        "wind, noise, mass and motors.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    option = parser.add_argument
    option("--flights", type=int, default=1000, metavar="N", help="(default %(default)s)")
    add_vehicle(parser)
    add_scenario(parser)
    add_profile(parser)
    option("--seed", type=int, default=1, metavar="N", help="of the draw (default %(default)s)")
    option(
        "--jobs",
        type=int,
        default=cores(),
        metavar="N",
        help="processes (default: one per core, %(default)s)",
    )
    option(
        "--out", type=Path, metavar="DIR", help="result folder (default results/<time>-campaign)"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    try:
        if options.flights < 1 or options.jobs < 1 or options.seed < 0:
            raise ConfigurationError("--flights and --jobs must be 1 or more, --seed 0 or more")
        vehicle = load_description(options.vehicle)
        load_scenario(options.scenario, vehicle)  # an invalid one is refused before any flight
        profile = given_profile(options.profile, vehicle)
        return campaign(options, profile, make_folder(options.out, "campaign"))
    except (
        ConfigurationError,
        ProfileError,
        ScenarioError,
        VehicleError,
        ResultFolderError,
        OSError,
    ) as error:
        print(f"uam campaign: {error}", file=sys.stderr)
        return WRONG_USE


def campaign(options: argparse.Namespace, profile: Profile, out: Path) -> int:
    """Fly, then write the results; return the exit status."""
    from uam_lab.campaign import campaign_report
    from uam_lab.campaign.flown import Flown
    from uam_lab.campaign.variations import draw, ranges

    draws = draw(profile, options.flights, options.seed, scenario=options.scenario)
    vehicle = profile.vehicle
    settings = (options.seed, ranges(), profile.sets, profile.bridge())
    flown = Flown(out, (*settings, vehicle.numbers, options.scenario))
    trials = [one.trial for one in draws if one.trial.seed not in flown.results]
    if flown.results:
        print(f"campaign: continuing after {len(flown.results)} earlier flights", flush=True)
    with Counting("campaign", len(draws)) as counting:

        def show(done: int, result: TrialResult) -> None:
            flown.add(result)
            bad = sum(not one.completed for one in flown.results.values())
            counting.show(len(draws) - len(trials) + done, f"{bad} not completed")

        fly_all(trials, options.jobs, progress=show)
    results = [flown.results[one.trial.seed] for one in draws]
    command = shlex.join(["uam", *sys.argv[1:]])
    print(campaign_report.write(out, draws, results, vehicle.name, command))
    print(f"results  {out}")
    return 0
