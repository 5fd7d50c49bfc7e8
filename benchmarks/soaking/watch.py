"""Flies and samples the usage of the processes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import psutil

from soaking.samples import Soak, usage
from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.experiments.budget.shuttle import shuttle
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.flights.processes.process_table import nodes
from uam_lab.records.results.result_folder import new_folder
from uam_sim_bridge.plant import Vehicle

PERIOD = 10.0  # [s] wall time between two samples
SPOKEN = 30  # samples between two lines of progress
ORCHESTRATOR = "uam fly"


def flight(
    duration: float, clock: str, log_limit: float, out: Path, further: Sequence[str] = ()
) -> Soak:
    """Fly once for `duration` [s] with all nodes; log_limit [MB]; results in `out`/flight.

    further: options of `uam fly`.
    """
    scenario = out / "shuttle.yaml"
    scenario.write_text(shuttle(duration))
    log = out / "flight.txt"
    command = ["-m", "uam_lab.cli.main", "fly", "--scenario", str(scenario)]
    command += ["--clock", clock, "--no-video", "--log-limit", str(log_limit)]
    command += further
    folder = new_folder(out, "flight")
    with log.open("w") as output:
        run = subprocess.Popen(
            [sys.executable, *command, "--out", str(folder)],
            stdout=output,
            stderr=output,
            process_group=0,  # Ctrl-C does not reach it; this process sends SIGINT once
        )
    layout = ", fused" if "--fused" in further else ""
    soak = Soak(f"{duration / 60.0:g} minutes through the nodes, {clock}{layout}", "wall time")
    while run.poll() is None:
        try:
            _look(soak, run, folder / "logs" / "mujoco_sim.json")
            run.wait()
        except KeyboardInterrupt:
            soak.interrupted = True
            run.send_signal(signal.SIGINT)
    _conclude(soak, folder, duration, log)
    return soak


def _look(soak: Soak, run: subprocess.Popen, ended: Path) -> None:
    """Sample until the plant has written its statistics (at its end) or the run has ended."""
    begin, looks = time.monotonic(), 0
    while run.poll() is None and not ended.exists():
        now = time.monotonic() - begin
        below = psutil.Process(run.pid).children(recursive=True)
        found = {name: node.pid for node, name in nodes(below).items()}
        for name, pid in {ORCHESTRATOR: run.pid, **found}.items():
            used = usage(pid)
            if used is not None:
                soak.add(name, now, used)
        looks += 1
        if looks % SPOKEN == 0:
            total = sum(samples[-1][1].memory for samples in soak.usage.values())
            print(f"soak: {now / 60.0:.0f} min, {total:.0f} MB in all", flush=True)
        time.sleep(PERIOD)


def _conclude(soak: Soak, folder: Path, duration: float, log: Path) -> None:
    """Judge the flight in `folder` by its statistics; log: what `uam fly` has printed."""
    try:
        plant = json.loads((folder / "logs" / "mujoco_sim.json").read_text())
        recorder = json.loads((folder / "logs" / "recorder.json").read_text())
    except OSError:
        soak.failed = True
        said = log.read_text().split("\n")
        soak.notes.append(next((line for line in reversed(said) if line), "uam fly said nothing"))
        return
    soak.failed = not soak.interrupted and (
        plant["ended_by"] != "mission" or plant["simulated_s"] < 0.9 * duration
    )
    if soak.interrupted:
        soak.title = f"{plant['simulated_s'] / 60.0:.0f} of {soak.title}"
    soak.notes += [
        f"flown    {plant['simulated_s']:.0f} s in {plant['wall_s']:.0f} s, "
        f"ended by: {plant['ended_by']}",
        f"log      {(folder / 'log.mcap').stat().st_size / 1e6:.0f} MB, {recorder['ended']}; "
        f"{sum(recorder['lost'].values())} messages lost",
    ]
    if plant["clock"] == "realtime":
        total = plant["answerable_ticks"]
        soak.notes.append(f"missed   {plant['missed_ticks']} of {total} control ticks")


def missions(duration: float) -> Soak:
    """Fly missions in the direct engine, all in this process, for `duration` [s] in total."""
    scenario, profile = load_scenario("pick_and_place"), load_profile("s500")
    soak, flown, completed, number = Soak("missions in one process", "simulated time"), 0.0, 0, 0
    begin = time.monotonic()
    while flown < duration:
        one = DirectFlight(
            scenario, profile, Vehicle.load(), scenario.payload_mass, seed=number + 1
        )
        try:
            one.run()
        except KeyboardInterrupt:
            soak.interrupted = True
            break
        number += 1
        flown += one.plant.time
        completed += one.mission.output.done and not one.mission.output.abort_reason
        soak.add("direct engine", flown, usage(os.getpid()))
        if number % SPOKEN == 0:
            print(f"soak: {flown / 60.0:.0f} min simulated, {number} missions", flush=True)
    soak.title = f"{flown / 60.0:.0f} minutes of missions in one process"
    soak.failed = completed < number
    took = time.monotonic() - begin
    soak.notes.append(
        f"flown    {completed} of {number} missions completed, {flown:.0f} s in {took:.0f} s"
    )
    return soak
