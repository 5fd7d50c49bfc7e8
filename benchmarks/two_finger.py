"""Pick and place by the two-finger gripper: three boxes, two heights, many seeds.

    python benchmarks/two_finger.py [--seeds 20] [--plant-preset laboratory]

Every flight is that of config/scenarios/two_finger.yaml with another box on another stand, by the
direct engine. Placed: at rest within 3 cm of the drop point. The last column is how far the box has
crept in the fingers from the lift to the release.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from uam_control.profiles.profile import default_profile
from uam_control.settings import configuration, yaml_file
from uam_control.vehicle import load_description
from uam_lab.experiments.trials.trial import Trial, figures_of, recorded
from uam_lab.records.results.timeseries import TRUTH, Series
from uam_sim_bridge.plant.effects import presets

WIDTHS, HEIGHTS = (0.03, 0.04, 0.05), (0.6, 0.727)  # [m] of the box, of the stand
PLACED = 0.03  # [m]
LAW = "modular"


def scenario(width: float, height: float) -> dict[str, Any]:
    """Return the scenario with a box of `width` [m] on a stand of `height` [m]."""
    file = configuration.named("scenarios", "two_finger")
    made = yaml_file.read(file, ValueError)
    stand, box, _ = made["environment"]
    higher = height - 0.727  # than in the file
    stand["height"], box["size"] = height, [width, width, 0.05]
    for move in made["moves"]:
        if move["coordinate"] == "z" and move["until"] <= 18:
            move["to"] = round(move["to"] + higher, 6)
    return made


def crept(series: Series) -> float:
    """Return how far [mm] the box moves between the fingers, from the lift to the release."""
    at = [series.row_at(time) for time in (18.0, 32.0)]
    tip = series.block(f"{TRUTH}.")[at, :3]
    box = series.block("payload.")[at, :3]
    return 1e3 * float(np.linalg.norm(np.diff(box - tip, axis=0)))


def main() -> None:
    """Fly, print a row for each box and height."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20, help="flights: seeds 1 .. N")
    parser.add_argument("--plant-preset", default="calm")
    options = parser.parse_args()
    vehicle = load_description("s500_gripper")
    profile = default_profile(LAW, vehicle)
    changes = presets.added({}, presets.read((options.plant_preset,), ()))
    cases = itertools.cycle(itertools.product(WIDTHS, HEIGHTS))
    placed = 0
    print("| seed | box | stand | placed | error | crept | |\n|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for seed, (width, height) in zip(range(1, options.seeds + 1), cases, strict=False):
            file = Path(folder) / f"box_{seed}.yaml"
            file.write_text(yaml.safe_dump(scenario(width, height)))
            trial = Trial(LAW, profile, 0.2, seed, str(file), vehicle_changes=changes)
            flown = recorded(trial)
            found = figures_of(trial, flown, flown.abort_reason)
            error = found["payload_place_error_m"]
            good = found["mission_completed"] and error <= PLACED
            placed += good
            why = flown.failure or "; ".join(found["shortfalls"])
            print(
                f"| {seed} | {1e3 * width:.0f} mm | {height:g} m | {'yes' if good else 'no'} | "
                f"{1e3 * error:.0f} mm | {crept(flown.series):.1f} mm | {why} |",
                flush=True,
            )
    print(f"{placed} of {options.seeds} placed within {100 * PLACED:g} cm")


if __name__ == "__main__":
    main()
