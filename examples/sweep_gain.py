"""Sweep a gain: RMS position error over lambda_1 of the position controller.

    python examples/sweep_gain.py [FOLDER]

The direct engine flies the same law, estimator, autopilot and plant without middleware, in seconds.
"""

import sys
from pathlib import Path

import numpy as np

from uam_lab import Flight
from uam_lab.records.results.result_folder import new_folder

FACTORS = (0.5, 1.0, 2.0)


def fly(factor: float, out: Path):
    """Return the result of a flight with lambda_1 multiplied by `factor`."""
    flown = Flight(scenario="hover").settings.profile.sets["position_controller"]
    changed = {"lambda_1": factor * np.array(flown.lambda_1)}
    with Flight(
        scenario="hover",
        engine="direct",
        parameters={"position_controller": changed},
        out=out / f"lambda_1_x{factor:g}",
    ) as flight:
        return flight.wait()


def main():
    """Print a row for each flight."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else new_folder(Path("results"), "sweep")
    print("lambda_1   RMS x, y, z [mm]         completed")
    for factor in FACTORS:
        result = fly(factor, out)
        error = 1000.0 * np.array(result.metrics["rms"]["position_m"])
        print(f"x {factor:<6g}   {np.round(error, 2)!s:<24} {result.completed}")


if __name__ == "__main__":
    main()
