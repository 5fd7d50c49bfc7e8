"""Flies in lockstep, as fast as it goes, and measures pace, log and memory."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from growing.further_recorder import recording
from uam_control.laws import catalogue
from uam_control.mission import load_scenario
from uam_control.profiles.profile import default_profile
from uam_control.vehicle import load_description
from uam_lab.experiments.budget.flown import CONTROL
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.flights.processes.process_table import nodes
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.ports import INSTANCES, ports_of

LOOK_PERIOD = 1.0  # [s] of wall time between two samples of the memory
DIRECT = "direct"  # the engine without nodes


class NotFlown(RuntimeError):
    """A flight that did not begin or left no statistics; the text is one line."""


@dataclass(frozen=True)
class Point:
    """One point of a curve.

    what: the quantity that grows, and `size`, how much of it; layout: of the nodes, or DIRECT.
    ticks_per_second: of all vehicles together; memory [MB]: largest sum of the processes that fly,
    without shared pages; log [MB] of one vehicle per simulated minute.
    """

    what: str
    size: int
    layout: str
    ticks_per_second: float
    memory: float
    log: float


def through_nodes(
    what: str,
    size: int,
    layout: str,
    scenario: Path,
    out: Path,
    vehicle: str,
    vehicles: int = 1,
    further_topics: int = 0,
) -> Point:
    """Fly once. scenario: file; out: folder of this point; vehicle: name or file.

    vehicles: how many at once; further_topics: recorded a second time.

    Raises NotFlown.
    """
    out.mkdir(parents=True, exist_ok=True)
    first = INSTANCES - vehicles
    domain = ports_of(first).domain
    with ExitStack() as stack:
        if further_topics:
            stack.enter_context(recording(further_topics, domain, out))
        running = []
        for number in range(vehicles):
            command = [sys.executable, "-m", "uam_lab.cli.main", "fly", "--no-report"]
            command += ["--scenario", str(scenario), "--without", "scene"]
            command += ["--instance", str(first + number), "--domain", str(domain)]
            command += ["--vehicle", vehicle]
            command += ["--fused"] * (layout == "fused")
            command += ["--namespace", f"uav{number}"] * (vehicles > 1)
            command += ["--out", str(out / f"uav{number}")]
            output = stack.enter_context((out / f"uav{number}.txt").open("w"))
            running.append(subprocess.Popen(command, stdout=output, stderr=output))
        memory = _largest_memory(running)
    pace = log = 0.0
    for number in range(vehicles):
        plant = _plant(out / f"uav{number}", out / f"uav{number}.txt")
        pace += plant["ticks"] / plant["wall_s"]
        recorded = (out / f"uav{number}" / "log.mcap").stat().st_size / 1e6
        log += recorded / (plant["simulated_s"] / 60.0) / vehicles
    return Point(what, size, layout, pace, memory, log)


def _plant(folder: Path, output: Path) -> dict:
    try:
        plant = json.loads((folder / "logs" / "mujoco_sim.json").read_text())
    except OSError:
        plant = {}
    if not plant.get("ticks"):
        said = output.read_text().strip().splitlines()
        raise NotFlown(f"{folder}: {said[-1] if said else 'no output'}")
    return plant


def _largest_memory(running: Sequence[subprocess.Popen]) -> float:
    """Return the largest sum of the memory [MB] of the nodes that fly, until all have ended."""
    most = 0.0
    while any(one.poll() is None for one in running):
        total = 0.0
        for one in running:
            if one.poll() is None:
                below = psutil.Process(one.pid).children(recursive=True)
                total += sum(_own(node) for node, name in nodes(below).items() if name in CONTROL)
        most = max(most, total)
        time.sleep(LOOK_PERIOD)
    return most


def _own(process: psutil.Process) -> float:
    try:
        memory = process.memory_info()
    except psutil.Error:
        return 0.0
    return (memory.rss - memory.shared) / 1e6


def direct(what: str, size: int, scenario: Path, vehicle: str) -> Point:
    """Fly once in the direct engine, in this process."""
    described = load_description(vehicle)
    profile, loaded = (
        default_profile(catalogue.DEFAULT, described),
        load_scenario(str(scenario), described),
    )
    given = (loaded, profile, Vehicle.of(described), 0.0)
    DirectFlight(*given, seed=1).run()  # compiles what this vehicle needs
    flight = DirectFlight(*given, seed=1)
    begun = time.perf_counter()
    flight.run()
    pace = flight.plant.tick / (time.perf_counter() - begun)
    return Point(what, size, DIRECT, pace, np.nan, np.nan)
