"""`uam faults`: faults at every moment of the mission, with their outcomes.

Fly the mission once for each fault and moment, and classify the outcome.

examples:
  uam faults                                 the matrix of config/campaign/faults.yaml
  uam faults --list                          list all faults, with parameters and ranges
  uam faults --only motor_loss --moment transit
  uam faults --matrix mine.yaml --profile asmc2
  uam faults --only motor_loss --vehicle mine.yaml
  uam faults --matrix processes --engine ros --clock realtime --repeat 3
  uam faults --matrix cables --engine rehearsal --config my_lab.yaml
  uam faults --matrix random --draws 100 --seed 3      100 random flights: one fault, or two
  uam faults --out matrix                    stop with Ctrl-C; the same command continues
  uam fly --fault motor_loss@pick+1:remaining=0.7      one flight with its report

Results in --out: report.html with the matrix in colours, summary.md, faults.json, matrix.png, every
flight in flights.parquet and flights.csv. The same seed gives the same flights, except with process
faults. Exit status: 0 all promises of the matrix kept, 1 a promise broken, 2 wrong use.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from uam_control.settings import configuration
from uam_control.vehicle import DEFAULT_VEHICLE, load_description
from uam_lab.cli.command import (
    Command,
    again,
    chosen_effects,
    count,
    given_profile,
    place_of,
    refuse_given,
)
from uam_lab.flights.conclude import command_line
from uam_lab.flights.flight_options import CLOCKS, ENGINES, check_clock
from uam_lab.flights.flight_settings import require_ros
from uam_lab.flights.vehicle.lab_file import TEMPLATE, load_lab, settings_of
from uam_lab.records.results.result_folder import make_folder
from uam_lab.records.results.terminal import say
from uam_sim_bridge.faults import fault_catalogue
from uam_sim_bridge.faults.feasibility import REHEARSAL
from uam_sim_bridge.plant.effects import presets

if TYPE_CHECKING:
    from uam_lab.experiments.faults.trial import FaultResult

BROKEN = 1


def add(command: Command) -> None:
    command.switch("--list", "list the faults; do not fly")
    text = "faults and moments, as config/campaign/faults.yaml"
    command.option("--matrix", "NAME|FILE", text, "faults")
    command.repeated("--only", "FAULT", "only this fault of the matrix")
    command.repeated("--moment", "NAME", "only this moment of the matrix")
    command.option("--scenario", "NAME|FILE", "default: that of the matrix")
    command.vehicle("the lab file's")
    command.profile()
    command.plant()
    about = f"{REHEARSAL}: the vehicle's nodes on emulated devices, for faults of cables"
    command.choice("--engine", (*ENGINES, REHEARSAL), "direct", about)
    command.config(TEMPLATE)
    command.choice("--clock", CLOCKS, "lockstep", "of the ROS engine")
    command.seed("of all noise")
    command.workers(with_ros=True)
    command.option("--repeat", "N", "flights per fault and moment", 1, type=count)
    command.option(
        "--draws", "N", "fly N random flights of the matrix: one fault, or two", type=count
    )
    command.out()


def run(options: argparse.Namespace) -> int:
    if options.list:
        say(fault_catalogue.listing())
        return 0
    from uam_lab.experiments.faults import matrix as fault_matrix
    from uam_lab.experiments.faults import report
    from uam_lab.experiments.faults.trial import ROWS, FaultTrial
    from uam_lab.experiments.trials.carried import inputs
    from uam_lab.experiments.trials.experiment import TABLE, Experiment
    from uam_lab.experiments.trials.trial import feasible

    place = place_of(options)
    check_clock(options.engine, options.clock)
    if options.engine != "direct":
        require_ros()
    rehearsed = options.engine == REHEARSAL
    if rehearsed:
        refuse_given(
            "not with --engine rehearsal: the lab file has it",
            vehicle=options.vehicle,
            profile=options.profile,
            plant_preset=options.plant_preset,
            effect=options.effects,
        )
        from uam_lab.experiments.faults.rehearsed import measure  # needs ROS

        lab = load_lab(options.config)
        vehicle, profile = lab.vehicle, settings_of(lab).profile
    else:
        from uam_lab.experiments.faults.trial import measure

        vehicle = load_description(options.vehicle or DEFAULT_VEHICLE)
        lab, profile = None, given_profile(options.profile, vehicle)
    file = configuration.named("campaign", options.matrix)
    given = (options.engine, options.only, options.moment, options.scenario)
    matrix = fault_matrix.read(file, *given, vehicle, options.draws or 0)
    for name, why in matrix.left_out.items():
        say(f"left out: {name}: {why}")
    cells = matrix.cells(options.seed, options.repeat)
    kind = "cables" if rehearsed else "faults"
    mass = feasible(matrix.scenario, profile).payload_mass
    changes = presets.added({}, chosen_effects(options))
    out = make_folder(options.out, kind)
    flight = partial(
        FaultTrial,
        profile=profile,
        payload_mass=mass,
        seed=options.seed,
        scenario=matrix.scenario,
        vehicle_changes=changes,
        engine=options.engine,
        clock=options.clock,
        lab=options.config if rehearsed else "",
        broken=out / "broken",
    )
    known = replace(matrix, draws=bool(matrix.draws))  # more draws are a longer table
    settings = {name: str(vars(options)[name]) for name in ("seed", "repeat", "engine", "clock")}
    further = lab, profile.sets, profile.bridge(), changes
    of = settings | {"matrix": known, "profile and effects": further}
    experiment = Experiment(
        kind, out / TABLE, ROWS, inputs(vehicle, matrix.scenario, of), place, measure
    )
    trials = [flight(label=cell.fault, faults=cell.schedule, cell=cell) for cell in cells]
    results = experiment.fly_all(trials, _about)
    where = {"engine": options.engine, "scenario": matrix.scenario}
    one = again("fly", options, **where, seed=options.seed, vehicle=options.vehicle)
    summary, page = report.write(out, matrix, results, vehicle.name, command_line(), one)
    say(summary)
    say(f"report   {page}")
    return BROKEN if any(result.kept is False for result in results) else 0


def _about(one: FaultResult) -> str:
    moment = f", {one.moment}" if one.moment else ""
    return f"{one.fault}{moment}: {one.outcome}"
