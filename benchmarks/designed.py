"""Design twelve vehicles that nobody tuned, and fly them; print a table.

    .venv/bin/python benchmarks/designed.py                    # direct engine, seed 1
    .venv/bin/python benchmarks/designed.py octo_8000 quad_3750 --seeds 3
    .venv/bin/python benchmarks/designed.py --plant-preset laboratory    # all effects
    .venv/bin/python benchmarks/designed.py --seeds 20 --flown flown.jsonl    # can be continued

Each vehicle is written without gains (designing/vehicles.py), designed as by uam vehicle design,
and flies a hover, a circle at 1 m/s, motions of each joint, and a pick of 5 % of its mass; the
table has median and largest error over the seeds. A preset's numbers are those of an S-500: they
grow with the vehicle. Exit status 1: a flight is not completed, or its position is beyond 10 mm
RMS, 25 mm with effects.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from designing import vehicles

from uam_control.vehicle import load_description
from uam_lab.experiments.design.criteria import DesignError, load_criteria
from uam_lab.experiments.design.search import design
from uam_lab.experiments.trials.trial import Trial, TrialFailed, TrialResult, measure
from uam_sim_bridge.plant.effects import presets

HEADINGS = (
    *("vehicle", "kg", "rotors", "lag [ms]", "joints", "delay margin [ms]"),
    *(f"{name} [mm]" for name in vehicles.SCENARIO_NAMES),
    "end",
)
CALM, HARD = 0.010, 0.025  # [m] largest RMS of the position, 3-D, and with effects


class Flown:
    """Results so far, by vehicle, presets, scenario and seed; in a file, too, if there is one."""

    def __init__(self, file: Path | None) -> None:
        self._file, self._found = file, {}
        if file is not None and file.exists():
            for line in file.read_text(encoding="utf-8").splitlines():
                key, result = json.loads(line)
                self._found[tuple(key)] = result

    def get(self, *key: str | int) -> list | None:
        """Return what was added with the key, None: nothing."""
        return self._found.get(key)

    def add(self, result: list, *key: str | int) -> list:
        """Keep a result, and return it."""
        self._found[key] = result
        if self._file is not None:
            with self._file.open("a", encoding="utf-8") as file:
                file.write(json.dumps([key, result]) + "\n")
        return result


def row(made: vehicles.Made, seeds: int, preset: list[str], flown: Flown) -> tuple[str, ...]:
    """Design and fly one vehicle on the calm plant, or that of a preset; return its row."""
    changes = presets.added({}, vehicles.grown(made, presets.read(preset, ())))
    plant, most, profile = "+".join(preset), HARD if preset else CALM, None
    rotors = made.places * (2 if made.coaxial else 1)
    about = (made.name, f"{made.mass:g}", f"{rotors}", f"{1e3 * made.lag:g}", f"{made.joints}")
    delay, cells, ends = flown.get(made.name, "delay margin"), [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = vehicles.write(made, folder)
        for scenario, path in vehicles.scenarios(made, folder).items():
            mass = vehicles.PAYLOAD * made.mass if scenario == vehicles.PICK else 0.0
            errors = []
            for seed in range(1, seeds + 1):
                key = made.name, plant, scenario, seed
                if (result := flown.get(*key)) is None:
                    if profile is None:
                        begun = time.process_time()
                        try:
                            profile = design(load_description(file), load_criteria()).profile
                        except DesignError as error:
                            return (*about, *[""] * (len(HEADINGS) - len(about) - 1), str(error))
                        took = time.process_time() - begun
                        delay = [1e3 * profile.sets["mission"].delay_margin]
                        flown.add(delay, made.name, "delay margin")
                        print(f"{made.name}: designed in {took:.0f} s", file=sys.stderr)
                    trial = Trial(made.name, profile, mass, seed, str(path), changes)
                    result = flown.add(_result(trial), *key)
                error, outcome = result
                errors.append(error)
                if outcome or not error <= most:
                    ends.append(f"{scenario}, seed {seed}: {outcome or 'error'}")
            worst, middle = 1e3 * max(errors), 1e3 * float(np.median(errors))
            cells.append(f"{worst:.1f}" if seeds == 1 else f"{middle:.1f}, {worst:.1f}")
    return (*about, f"{delay[0]:.0f}", *cells, "; ".join(ends) or "completed")


def _result(trial: Trial) -> list:
    """Fly; return the RMS of the distance to the reference [m], and what went wrong, "" nothing."""
    try:
        flown: TrialResult = measure(trial)
    except TrialFailed as error:
        return [float("nan"), str(error)]
    why = "" if flown.completed else f"{flown.outcome}, {flown.why}"
    return [float(np.linalg.norm(flown.rms[:3])), why]


def main() -> int:
    """Print the table as markdown; return the exit status."""
    names = [made.name for made in vehicles.VEHICLES]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("vehicles", nargs="*", metavar="NAME", help=", ".join(names))
    parser.add_argument("--seeds", type=int, default=1, metavar="N", help="1 to N are flown")
    parser.add_argument("--plant-preset", nargs="+", metavar="NAME", default=[])
    parser.add_argument("--flown", type=Path, metavar="FILE", help="keeps flights, is continued")
    options = parser.parse_args()
    if strange := sorted({*options.vehicles} - {*names}):
        parser.error(f"{strange[0]}: there are {', '.join(names)}")
    flown, good = Flown(options.flown), True
    print(f"| {' | '.join(HEADINGS)} |\n|{'---|' * len(HEADINGS)}")
    for made in vehicles.VEHICLES:
        if not options.vehicles or made.name in options.vehicles:
            cells = row(made, options.seeds, options.plant_preset, flown)
            good &= cells[-1] == "completed"
            print(f"| {' | '.join(cells)} |", flush=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
