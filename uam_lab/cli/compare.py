"""`uam compare`: all controllers over the same flights: the paper's tables and figures.

Fly every controller over the same payloads and seeds; write the paper's three tables and five
figures.

examples:
  uam compare                          every controller, payloads 0.1 0.2 0.3 kg, 5 seeds
  uam compare --seeds 10 --jobs 4
  uam compare --out mine               stop with Ctrl-C; the same command continues
  uam compare --engine ros --rows proposed --seeds 10    with the nodes, one flight at a time
  uam compare --profile mine=mine.yaml     with one more row, for the profile mine.yaml
  uam compare --plant-preset laboratory    on a plant with the effects of a laboratory
  uam compare --vehicle mine.yaml --scenario hover --rows proposed frozen

Results in --out: report.html, tables.md, flights.csv, flights.parquet, comparison.json, figures/.
The baselines are reconstructions (docs/law.md). The same command gives the same tables.
"""

import argparse

from uam_control.laws import catalogue
from uam_control.mission.scenarios.environment import HEAVIEST
from uam_control.profiles.profile import Profile, default_profile, load_profile
from uam_control.settings import configuration
from uam_control.settings.configuration import ConfigurationError
from uam_control.vehicle import VehicleDescription, load_description
from uam_lab.cli.command import Command, chosen_effects, count, number, place_of
from uam_lab.experiments.compare import plan
from uam_lab.experiments.trials.trial import TrialResult, feasible, result_rows
from uam_lab.flights.conclude import command_line
from uam_lab.flights.flight_options import ENGINES
from uam_lab.flights.flight_settings import require_ros
from uam_lab.records.results.result_folder import make_folder
from uam_lab.records.results.terminal import say


def add(command: Command) -> None:
    command.vehicle()
    command.scenario()
    command.option("--seeds", "N", "seeds 1..N", 5, type=count)
    mass = number("mass", "kg", 0.0, HEAVIEST)
    text = f"payloads (default {' '.join(map(str, plan.PAYLOADS))})"
    command.option("--payload-mass", "KG", text, type=mass, nargs="+")
    command.choice("--engine", ENGINES, "direct", "nodes and sockets, or one loop without them")
    text = f"rows of the tables: {', '.join(plan.ROWS)} (default: all)"
    command.option("--rows", "NAME", text, nargs="+", choices=tuple(plan.ROWS))
    command.repeated("--profile", "LABEL=FILE", "an additional row")
    command.plant()
    command.workers(with_ros=True)
    command.out()


def _further(text: str, vehicle: VehicleDescription) -> tuple[str, Profile]:
    label, _, file = text.partition("=")
    if not label or not file:
        raise ConfigurationError(f"--profile {text}: LABEL=FILE is expected")
    return label, load_profile(str(configuration.named("profiles", file)), vehicle=vehicle)


def _about(result: TrialResult) -> str:
    return f"{result.label}, {result.payload_mass:g} kg, seed {result.seed}"


def run(options: argparse.Namespace) -> int:
    from uam_lab.experiments.compare import comparison_report, modularity
    from uam_lab.experiments.trials.carried import inputs
    from uam_lab.experiments.trials.experiment import TABLE, Experiment

    if options.engine == "ros":
        require_ros()
    place, payloads = place_of(options), tuple(options.payload_mass or plan.PAYLOADS)
    vehicle = load_description(options.vehicle)
    scenario = options.scenario
    rows = plan.entries(options.rows or tuple(plan.ROWS), vehicle)
    for text in options.profile:
        label, profile = _further(text, vehicle)
        if rows.setdefault(label, profile) is not profile:
            raise ConfigurationError(f"--profile {text}: the row {label} is there already")
    for profile in rows.values():
        feasible(scenario, profile)
    effects = chosen_effects(options)
    out = make_folder(options.out, "compare")
    (out / "flights").mkdir(exist_ok=True)
    seeds = tuple(range(1, options.seeds + 1))
    flights = plan.Flights(vehicle, scenario, payloads, seeds, options.engine, effects)
    trials = plan.trials(rows, flights, out / "flights")
    proposed = default_profile(catalogue.DEFAULT, vehicle)
    kept = out / "flights" / "modularity.parquet"
    # direct engine: these flights compare the laws only, which are the same in both engines
    every = [*trials, *modularity.trials(proposed, flights, kept)]
    profiles = [(label, one.sets, one.bridge()) for label, one in rows.items()]
    of = {"profiles": profiles, "flights": (payloads, seeds, options.engine, effects)}
    table = result_rows(len(vehicle.joints))
    comparison = Experiment("compare", out / TABLE, table, inputs(vehicle, scenario, of), place)
    results = comparison.fly_all(every, _about)
    comparison.write_csv()
    results, others = results[: len(trials)], results[len(trials) :]
    modular = modularity.evidence(proposed, kept, others)
    facts = {
        "command": command_line(),
        "engine": options.engine,
        "vehicle": vehicle.name,
        "scenario": scenario,
        "payloads_kg": payloads,
        "seeds": seeds,
        "effects": effects,
        "profiles": {label: one.file.name for label, one in rows.items()},
        "budgets": comparison_report.budgets(rows),
    }
    text, page = comparison_report.write(out, trials, results, modular, facts)
    say(text)
    say(f"vehicle  {vehicle.name}\nresults  {out}\nreport   {page}")
    return 0
