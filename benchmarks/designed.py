"""Design twelve vehicles that nobody tuned, and fly them; print a table.

    .venv/bin/python benchmarks/designed.py                    # direct engine, seed 1
    .venv/bin/python benchmarks/designed.py octo_8000 quad_3750 --seeds 1 2 3
    .venv/bin/python benchmarks/designed.py --plant-preset laboratory    # all effects

Each vehicle is written without gains (designing/vehicles.py), designed as by uam vehicle design,
and flies a hover, a circle at 1 m/s, motions of each joint, and a pick of 5 % of its mass. Exit
status 1: a flight is not completed, or its position is beyond 10 mm RMS, 25 mm with effects.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from designing import vehicles

from uam_control.vehicle import load_description
from uam_lab.experiments.design.criteria import DesignError, load_criteria
from uam_lab.experiments.design.search import design
from uam_lab.experiments.trials.trial import Trial, TrialResult, measure
from uam_sim_bridge.plant.effects import presets

HEADINGS = (
    *("vehicle", "kg", "rotors", "lag [ms]", "joints", "delay margin [ms]", "design [s]"),
    *(f"{name} [mm]" for name in vehicles.SCENARIO_NAMES),
    "end",
)
CALM, HARD = 0.010, 0.025  # [m] largest RMS of the position, 3-D, and with effects


def row(made: vehicles.Made, seeds: list[int], preset: list[str]) -> tuple[str, ...]:
    """Design and fly one vehicle on the calm plant, or that of a preset; return its row."""
    changes = presets.added({}, presets.read(preset, ()))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        described = load_description(vehicles.write(made, folder))
        about = (made.name, f"{made.mass:g}", str(len(described.rotors)), f"{1e3 * made.lag:g}")
        begun = time.perf_counter()
        try:
            found = design(described, load_criteria())
        except DesignError as error:
            empty = ("",) * (len(HEADINGS) - len(about) - 2)
            return (*about, str(made.joints), *empty, str(error))
        took = time.perf_counter() - begun
        cells, ends = [], []
        for name, file in vehicles.scenarios(made, folder).items():
            mass = vehicles.PAYLOAD * made.mass if name == vehicles.PICK else 0.0
            flown = [
                measure(
                    Trial(made.name, found.profile, mass, k, str(file), vehicle_changes=changes)
                )
                for k in seeds
            ]
            errors = [rms_of(one) for one in flown]
            cells.append(f"{1e3 * max(errors):.1f}")
            ends += [f"{name}: {one.why}" for one in flown if not one.completed]
            most = HARD if preset else CALM
            ends += [f"{name}: error" for error in errors if not error <= most]
    delay = 1e3 * found.profile.sets["mission"].delay_margin
    end = "; ".join(dict.fromkeys(ends)) or "completed"
    return (*about, str(made.joints), f"{delay:.0f}", f"{took:.1f}", *cells, end)


def rms_of(flown: TrialResult) -> float:
    """Return the RMS of the distance to the reference [m]."""
    return float(np.linalg.norm(flown.rms[:3]))


def main() -> int:
    """Print the table as markdown; return the exit status."""
    names = [made.name for made in vehicles.VEHICLES]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("vehicles", nargs="*", metavar="NAME", help=", ".join(names))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--plant-preset", nargs="+", metavar="NAME", default=[])
    options = parser.parse_args()
    if strange := sorted({*options.vehicles} - {*names}):
        parser.error(f"{strange[0]}: there are {', '.join(names)}")
    print(f"| {' | '.join(HEADINGS)} |\n|{'---|' * len(HEADINGS)}")
    good = True
    for made in vehicles.VEHICLES:
        if not options.vehicles or made.name in options.vehicles:
            cells = row(made, options.seeds, options.plant_preset)
            good &= cells[-1] == "completed"
            print(f"| {' | '.join(cells)} |", flush=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
