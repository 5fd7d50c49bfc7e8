"""`uam campaign`: many random flights: success rate, errors, conditions of the losses.

Fly the mission many times in the direct engine, each with another payload, wind, noise, mass and
motors.

examples:
  uam campaign                             1,000 flights of the flying profile
  uam campaign --flights 100 --profile asmc2
  uam campaign --flights 100 --vehicle mine.yaml
  uam campaign --draws 181,389             two of the 1,000 flights
  uam campaign --draws 181 --replay        one of them again, with report and video
  uam campaign --ranges delays             late setpoints and poses as well, up to 30 ms
  uam campaign --plant-preset laboratory   with the ranges of that plant
  uam campaign --out robust                stop with Ctrl-C; the same command continues
  uam campaign --flights 10000 --scheduler tcp://10.0.0.5:8786    on a cluster of yours

Mass and position of the payload, wind, gusts, sensor noise, masses, inertias and motors are drawn
from the ranges of config/campaign/robustness.yaml, or of the file there that is called as the
plant's preset; --ranges names another one. Results in --out: report.html,
summary.md, campaign.json, campaign.png, and every flight in flights.parquet and flights.csv. The
same seed gives the same flights on any number of workers; more --flights only add some.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from uam_control.settings import configuration
from uam_control.vehicle import load_description
from uam_lab.cli.command import (
    Command,
    again,
    chosen_effects,
    count,
    given_profile,
    place_of,
)
from uam_lab.experiments.trials.trial import Trial, TrialResult, feasible, result_rows
from uam_lab.flights.conclude import command_line
from uam_lab.flights.flight_settings import SettingsError
from uam_lab.records.results.result_folder import make_folder
from uam_lab.records.results.terminal import say

USUAL = "robustness"


def add(command: Command) -> None:
    command.option("--flights", "N", "", 1000, type=count)
    command.option("--draws", "I,I,...", "only these flights, counted from 0 (default: all)", "")
    command.switch("--replay", "fly the one flight of --draws as uam fly does: report and video")
    command.vehicle()
    command.scenario()
    command.profile()
    draw = "values to draw: robustness, laboratory, delays (default: the plant's, or robustness)"
    command.option("--ranges", "NAME|FILE", draw, "")
    command.plant()
    command.seed("of the draw")
    command.workers()
    command.out()


def run(options: argparse.Namespace) -> int:
    from uam_lab.experiments.campaign.variations import Draws, ranges

    place = place_of(options)
    vehicle = load_description(options.vehicle)
    profile = given_profile(options.profile, vehicle)
    feasible(options.scenario, profile)
    options.ranges = options.ranges or usual_ranges(options.plant_preset)
    allowed = ranges(configuration.named("campaign", options.ranges))
    effects = chosen_effects(options)
    draws = Draws(profile, options.flights, options.seed, allowed, options.scenario, effects)
    numbers = draws.chosen(options.draws)
    if options.replay:
        if len(numbers) != 1 or not options.draws:
            raise SettingsError("--replay needs one flight: --draws I")
        return _replay(draws[numbers[0]], numbers[0], options.out)

    from uam_lab.experiments.campaign import report
    from uam_lab.experiments.trials.carried import inputs
    from uam_lab.experiments.trials.experiment import TABLE, Experiment

    out = make_folder(options.out, "campaign")
    given = {"--seed": str(options.seed), "ranges": allowed, "effects": effects}
    given["profile"] = (profile.sets, profile.bridge())
    rows = result_rows(len(vehicle.joints), draws.names)
    bad = 0

    def describe(result: TrialResult) -> str:
        nonlocal bad
        bad += not result.completed
        return f"{bad} not completed"

    campaign = Experiment(
        "campaign", out / TABLE, rows, inputs(vehicle, options.scenario, given), place
    )
    results = campaign.fly(numbers, draws.__getitem__, describe)
    campaign.write_csv()
    names = ("flights", "seed", "vehicle", "scenario", "ranges")
    more = again("campaign", options, **{name: vars(options)[name] for name in names})
    say(report.write(out, results, vehicle.name, command_line(), more))
    say(f"results  {out}\nreport   {out / 'report.html'}")
    return 0


def usual_ranges(presets: Sequence[str]) -> str:
    """Return the ranges of the last preset of the plant that has some, else the usual ones."""
    known = configuration.names("campaign")
    return next((name for name in reversed(presets) if name in known), USUAL)


def _replay(trial: Trial, number: int, out: Path | None) -> int:
    """Fly a trial with log, report and video; return the exit status."""
    from uam_lab.cli import fly

    settings = trial.settings(
        out=make_folder(None, "campaign", f"flight{number}") if out is None else out,
        controller=next(iter(trial.profile.laws().values())),
        engine="direct",
        command=command_line(),
    )
    return fly.fly(settings, video=True, report=True)
