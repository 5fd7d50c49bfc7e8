"""Measure the computing time of a direct flight relative to its physics, and where it goes.

    .venv/bin/python benchmarks/direct_engine.py
    .venv/bin/python benchmarks/direct_engine.py --runs 1 --picture docs/images/direct_engine.svg
    .venv/bin/python benchmarks/direct_engine.py --profile    # the slowest functions, too
    .venv/bin/python benchmarks/direct_engine.py --plant-preset laboratory --fault imu_bias@15+20

Alternates a part of the flight with the same number of `mj_step` of the same model, so that both
run under the same load. Prints the real-time factor, the ratio, and a table: where the time goes,
per tick of the flight. Times are CPU times of this process, on one core.
"""

from __future__ import annotations

import argparse
import cProfile
import os
import pstats
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import mujoco

from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.flights.direct.warm_up import prepare
from uam_sim_bridge.faults.schedule import read_schedule
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.effects import presets

STRETCH = 250  # ticks
PHYSICS, REST = "bare mj_step", "between the parts"
LOOP, OBJECTS = "compiled ticks beside mj_step", "ticks of the objects beside mj_step"
ASKED, READY, BACK = "whether something is to be decided", "path ahead", "back to the objects"
GRASP = "executive of the grasps"


class Flown(NamedTuple):
    """What flies the paper's mission: presets of the plant, faults as of `uam fly --fault`."""

    presets: Sequence[str]
    faults: Sequence[str]

    def flight(self, faulty: bool = True) -> DirectFlight:
        """Return a flight; faulty: with the faults."""
        scenario, vehicle = load_scenario("pick_and_place"), Vehicle.load()
        vehicle = vehicle.changed({"effects": presets.read(self.presets)})
        faults = read_schedule(self.faults if faulty else (), scenario, seed=1)
        flown = scenario, load_profile("s500"), vehicle, 0.2
        return DirectFlight(*flown, seed=1, faults=faults)


def measure(
    flown: Flown, watch: Callable[[DirectFlight], None] = lambda flight: None
) -> tuple[float, ...]:
    """Return time of a flight, time of its physics [s], simulated time [s], ticks.

    watch: prepares the flight.
    """
    flight, bare = flown.flight(), flown.flight(faulty=False)
    watch(flight)
    model, data = bare.plant.model, bare.plant.data
    steps = round(bare.plant.period / model.opt.timestep)
    time_flown = physics = 0.0
    while not flight.mission.output.done:
        before, begun = time.process_time(), flight.plant.tick
        while flight.plant.tick < begun + STRETCH and not flight.mission.output.done:
            flight.advance(STRETCH, STRETCH)
        between = time.process_time()
        for _ in range((flight.plant.tick - begun) * steps):
            mujoco.mj_step(model, data)
        time_flown += between - before
        physics += time.process_time() - between
    return time_flown, physics, flight.plant.time, flight.plant.tick


class Watch:
    """Adds up the time in each part of the ticks of a flight; `times` [s] and `calls` by name.

    Reading the clock takes about a microsecond, twice for a part: `inside` and `around` [s] are
    what a watched call measures of it, and what the rest of the tick has of it.
    """

    def __init__(self) -> None:
        self.times: dict[str, float] = {}
        self.calls: dict[str, int] = {}
        clock, nothing, count = time.process_time, self._timed("nothing", lambda: None), 20000
        begin = clock()
        for _ in range(count):
            nothing()
        whole = (clock() - begin) / count
        self.inside = self.times.pop("nothing") / self.calls.pop("nothing")
        self.around = whole - self.inside

    def __call__(self, flight: DirectFlight) -> None:
        """Watch a flight that begins."""
        self.compiled = compiled = flight.compiled
        for name, owner, method in (
            (ASKED, compiled, "_nominal"),
            (READY, compiled, "_renew"),
            (BACK, compiled, "_resume"),
            (GRASP, flight.mission, "watch"),
            (OBJECTS, flight, "tick"),
            (OBJECTS, compiled, "_finish"),
            (LOOP, compiled, "_run"),
        ):
            setattr(owner, method, self._timed(name, getattr(owner, method)))

    def _timed(self, name: str, run: Callable) -> Callable:
        times, calls, clock = self.times, self.calls, time.process_time
        times.setdefault(name, 0.0)
        calls.setdefault(name, 0)

        def timed(*arguments: Any) -> Any:
            begin = clock()
            result = run(*arguments)
            times[name] += clock() - begin
            calls[name] += 1
            return result

        return timed

    def of_the_flight(self, flown: float) -> dict[str, float]:
        """Return the times [s] without those of the watch, and the rest of `flown` [s]."""
        found = {name: took - self.inside * self.calls[name] for name, took in self.times.items()}
        watched = sum(self.times.values()) + self.around * sum(self.calls.values())
        return found | {REST: flown - watched}


def parts(flown: Flown) -> dict[str, float]:
    """Return where the time goes [us per tick], the longest first."""
    watch = Watch()
    whole, physics, _, ticks = measure(flown, watch)
    times = watch.of_the_flight(whole)
    share = watch.compiled.ticks / ticks
    times[LOOP] -= share * physics
    times[OBJECTS] -= (1.0 - share) * physics
    shown = {name: 1e6 * seconds / ticks for name, seconds in times.items()}
    print(f"{share:.1%} of the ticks are compiled, in {watch.calls[LOOP]} calls\n")
    return {PHYSICS: 1e6 * physics / ticks} | dict(sorted(shown.items(), key=lambda one: -one[1]))


def table(found: dict[str, float]) -> str:
    """Return the parts as a table."""
    total = sum(found.values())
    lines = ["| part | us per tick | |", "|---|---|---|"]
    lines += [f"| {name} | {us:.1f} | {us / total:.0%} |" for name, us in found.items()]
    return "\n".join([*lines, f"| all | {total:.1f} | |"])


def draw(found: dict[str, float], ratio: float, file: Path) -> None:
    """Draw the parts as bars."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 0.3 * len(found) + 1.0), layout="constrained")
    axes = figure.subplots()
    names = list(found)[::-1]
    colours = ["#888888" if name == PHYSICS else "#1f77b4" for name in names]
    bars = axes.barh(names, [found[name] for name in names], color=colours)
    axes.bar_label(bars, fmt="%.1f", padding=3)
    axes.set_xlabel(f"time per tick [us]; in all {ratio:.1f} times the physics")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(file, metadata={"Date": None} if file.suffix == ".svg" else None)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--profile", action="store_true", help="list the slowest functions")
    parser.add_argument("--picture", type=Path, help="file for a picture of the parts")
    parser.add_argument("--runs", type=int, default=5, help="runs; the best counts (default 5)")
    parser.add_argument("--plant-preset", nargs="*", default=[], help="effects of the plant")
    parser.add_argument("--fault", nargs="*", default=[], help="faults, as of uam fly")
    options = parser.parse_args()
    mission = Flown(options.plant_preset, options.fault)
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    prepare(print)
    flown, physics, simulated, _ = min(measure(mission) for _ in range(options.runs))
    print(f"flight          {flown:.2f} s for {simulated:.1f} s, {simulated / flown:.0f} x real")
    print(f"bare mj_step    {physics:.2f} s, {simulated / physics:.0f} x real")
    print(f"ratio           {flown / physics:.2f}\n")
    found = parts(mission)
    print(table(found))
    if options.picture:
        draw(found, flown / physics, options.picture)
    if options.profile:
        flight, profile = mission.flight(), cProfile.Profile()
        profile.runcall(flight.run)
        pstats.Stats(profile).sort_stats("tottime").print_stats(25)


if __name__ == "__main__":
    main()
