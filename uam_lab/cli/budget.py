"""`uam budget`: where the time of a control tick goes.

Fly with measured ticks: latency from the sensors to the setpoint, and where it goes.

examples:
  uam budget                               ten minutes in real time, every layout
  uam budget --minutes 1 --layout fused
  uam budget --scenario pick_and_place     another flight
  uam budget --clock lockstep              what the nodes cost where nobody waits for the clock
  uam budget --fifo 50 --lock-memory       with the options of uam fly for the processes
  uam budget --cores 2-3 --busy-poll 4     the nodes on cores of their own, without sleeping

It flies to and fro with a moving arm and measures every tick in every node. Results in --out:
budget.png, summary.md, budget.json, and the folder of each flight. docs/tick_budget.md explains
them. Nothing else should run on the machine.
Exit status: 0 measured, 1 a flight was not completed, 2 wrong use.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path

from uam_control.mission import load_scenario
from uam_control.settings.atomic import write_text
from uam_lab.cli.command import Command, chosen_process, number
from uam_lab.experiments.budget.path import NoTicks
from uam_lab.experiments.budget.shuttle import JOINTS, shuttle
from uam_lab.flights import flight_settings
from uam_lab.flights.conclude import command_line
from uam_lab.flights.flight_options import CLOCKS
from uam_lab.flights.flight_settings import FlightSettings, require_ros
from uam_lab.flights.library.flight_result import FlightFailed
from uam_lab.flights.processes.interrupts import INTERRUPTED, Interrupts
from uam_lab.flights.progress import Progress
from uam_lab.records.results.result_folder import make_folder
from uam_lab.records.results.terminal import Terminal, say

MEASURED, NOT_COMPLETED = 0, 1
SCENARIO = "shuttle.yaml"


def add(command: Command) -> None:
    minutes = number("time", "min", 0.5, 600.0)
    command.option("--minutes", "MIN", "length of the flight", 10.0, type=minutes)
    text = "in place of --minutes: a name of config/scenarios or a file"
    command.option("--scenario", "NAME|FILE", text)
    command.choice("--layout", ("all", "separate", "fused"), "all", "of the nodes")
    command.choice("--clock", CLOCKS, "realtime", "as of uam fly")
    command.vehicle()
    command.seed("of all noise")
    command.process()
    command.out()


def run(options: argparse.Namespace) -> int:
    require_ros()
    from uam_lab.experiments.budget import flown, report

    given = vars(options)
    process = chosen_process(given)
    layouts = flown.LAYOUTS if options.layout == "all" else (options.layout,)
    settings = flight_settings.settings(
        scenario=options.scenario or "hover",
        vehicle=options.vehicle,
        clock=options.clock,
        seed=options.seed,
        without=("scene",),
        process=process,
        tick_times=True,
        command=command_line(),
    )
    out = make_folder(options.out, "budget")
    if options.scenario is None:
        settings = _to_and_fro(settings, out, options)
    budgets, landing = [], settings.scenario.landing
    console = Terminal()
    for layout in layouts:
        console.print(f"layout {layout}")
        with Progress(console, landing.end) as progress, Interrupts() as stop:
            flight = replace(settings, out=out / layout, fused=layout == flown.FUSED)
            try:
                budgets.append(flown.fly(layout, flight, progress, stop))
            except (FlightFailed, NoTicks, OSError) as error:
                say(f"uam budget: {layout}: {error}", error=True)
        if stop.raised:
            break
    status = INTERRUPTED if stop.raised else NOT_COMPLETED
    if not budgets:
        return status
    facts = {
        "command": command_line(),
        "made": time.strftime("%Y-%m-%dT%H:%M:%S"),
        "scenario": settings.scenario.name,
        "vehicle": settings.vehicle.name,
        "process": settings.process.changes(),
    }
    report.write(out, budgets, facts)
    say(report.summary(budgets))
    say(f"results  {out}")
    whole = len(budgets) == len(layouts) and not any(one.failure for one in budgets)
    return MEASURED if whole and not stop.raised else status


def _to_and_fro(settings: FlightSettings, out: Path, options: argparse.Namespace) -> FlightSettings:
    """Return the settings with a scenario of the length --minutes, written to `out`."""
    file = out / SCENARIO
    arm = list(settings.vehicle.joint_names) == JOINTS
    write_text(file, shuttle(60.0 * options.minutes, arm))
    scenario = load_scenario(str(file), settings.vehicle)
    return replace(settings, scenario=scenario, scenario_source=str(file))
