"""`uam campaign`: many random flights around the nominal one."""

from __future__ import annotations

import argparse

from uam_control.mission import load_scenario
from uam_control.settings import configuration
from uam_control.vehicle import load_description
from uam_lab.campaign.pool import fly_all
from uam_lab.campaign.trial import TrialResult
from uam_lab.cli.command import Command, chosen_effects, count, given_profile, jobs_of
from uam_lab.cli.counting import Counting
from uam_lab.flight.conclude import command_line
from uam_lab.results.result_folder import make_folder

EXAMPLES = """\
examples:
  uam campaign                             1,000 flights of the flying profile
  uam campaign --flights 100 --profile asmc2
  uam campaign --flights 100 --vehicle mine.yaml
  uam campaign --draws 181,389             two of the 1,000 flights
  uam campaign --ranges delays             late setpoints and poses as well, up to 30 ms
  uam campaign --plant-preset laboratory
  uam campaign --out robust                stop with Ctrl-C; the same command continues

Mass and position of the payload, wind, gusts, sensor noise, masses, inertias and motors are drawn
from the ranges of config/campaign/robustness.yaml (--ranges). Results in --out: summary.md,
flights.csv, campaign.json, campaign.png. The same seed gives the same flights; more --flights only
add some.
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the subcommand to the command line."""
    command = Command(
        commands,
        "campaign",
        run,
        "many random flights: success rate, errors, conditions of the losses",
        "Fly the mission many times in the direct engine, each with another payload, "
        "wind, noise, mass and motors.",
        EXAMPLES,
    )
    command.option("--flights", "N", "", 1000, type=count)
    command.option("--draws", "I,I,...", "only these flights, counted from 0 (default: all)", "")
    command.vehicle()
    command.scenario()
    command.profile()
    command.option("--ranges", "NAME|FILE", "values to draw: robustness, delays", "robustness")
    command.plant()
    command.seed("of the draw")
    command.jobs()
    command.out()


def run(options: argparse.Namespace) -> int:
    """Fly, then write the results; return the exit status."""
    from uam_lab.campaign import campaign_report
    from uam_lab.campaign.flown import Flown
    from uam_lab.campaign.variations import chosen, draw, ranges

    vehicle = load_description(options.vehicle)
    load_scenario(options.scenario, vehicle)  # an invalid one is refused before any flight
    profile = given_profile(options.profile, vehicle)
    allowed = ranges(configuration.named("campaign", options.ranges))
    effects = chosen_effects(options)
    out = make_folder(options.out, "campaign")
    draws = draw(profile, options.flights, options.seed, allowed, options.scenario, effects)
    draws = chosen(draws, options.draws)
    settings = (options.seed, allowed, profile.sets, profile.bridge())
    flown = Flown(out, (*settings, vehicle.numbers, options.scenario, effects))
    trials = [one.trial for one in draws if one.trial.seed not in flown.results]
    if flown.results:
        print(f"campaign: continuing after {len(flown.results)} earlier flights", flush=True)
    with Counting("campaign", len(draws)) as counting:

        def show(done: int, result: TrialResult) -> None:
            flown.add(result)
            bad = sum(not one.completed for one in flown.results.values())
            counting.show(len(draws) - len(trials) + done, f"{bad} not completed")

        fly_all(trials, jobs_of(options), progress=show)
    results = [flown.results[one.trial.seed] for one in draws]
    print(campaign_report.write(out, draws, results, vehicle.name, command_line()))
    print(f"results  {out}")
    return 0
