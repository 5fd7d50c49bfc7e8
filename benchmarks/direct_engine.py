"""Measure the computing time of a direct flight relative to its physics, on one core.

    .venv/bin/python benchmarks/direct_engine.py [--profile] [--seconds 90]

Alternates a part of the flight with the same number of `mj_step` of the same model, so that both
run under the same load. Prints the real-time factor and the ratio; --profile lists the functions.
"""

from __future__ import annotations

import argparse
import cProfile
import os
import pstats
import time

import mujoco

from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.flight.direct.flight import DirectFlight
from uam_lab.flight.direct.warm_up import warm_up
from uam_sim_bridge.plant import Vehicle

STRETCH = 250  # ticks


def new_flight() -> DirectFlight:
    """Return a flight of the paper's mission."""
    return DirectFlight(
        load_scenario("pick_and_place"), load_profile("s500"), Vehicle.load(), 0.2, seed=1
    )


def measure() -> tuple[float, float, float]:
    """Return wall time of a flight, wall time of its physics, and simulated time [s]."""
    flight, bare = new_flight(), new_flight()
    model, data = bare.plant.model, bare.plant.data
    steps = round(bare.plant.period / model.opt.timestep)
    flown = physics = 0.0
    while not flight.mission.output.done:
        before = time.perf_counter()
        ticks = 0
        while ticks < STRETCH and not flight.mission.output.done:
            flight.tick()
            ticks += 1
        between = time.perf_counter()
        for _ in range(ticks * steps):
            mujoco.mj_step(model, data)
        flown += between - before
        physics += time.perf_counter() - between
    return flown, physics, flight.plant.time


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--profile", action="store_true", help="list the slowest functions")
    parser.add_argument("--runs", type=int, default=5, help="runs; the best counts (default 5)")
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    warm_up()
    flown, physics, simulated = min(measure() for _ in range(options.runs))
    print(f"flight          {flown:.2f} s for {simulated:.1f} s, {simulated / flown:.0f} x real")
    print(f"bare mj_step    {physics:.2f} s, {simulated / physics:.0f} x real")
    print(f"ratio           {flown / physics:.2f}")
    if options.profile:
        flight, profile = new_flight(), cProfile.Profile()
        profile.runcall(flight.run)
        pstats.Stats(profile).sort_stats("tottime").print_stats(25)


if __name__ == "__main__":
    main()
