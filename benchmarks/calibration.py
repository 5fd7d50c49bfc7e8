"""How PX4's own position control tracks fast curves on the calm plant and on the laboratory's.

    python benchmarks/calibration.py [--profiles px4_position s500] [--seeds 1]

The table has, over the phase "trajectory" of the direct engine's flights: 3-D RMSE in time; the
same after the best constant shift in time; RMS distance to the path. Results: docs/plant.md.
"""

from __future__ import annotations

import argparse

import numpy as np

from uam_control.profiles.profile import load_profile
from uam_lab.experiments.trials.trial import Trial, fly
from uam_lab.records.results.timeseries import Series
from uam_sim_bridge.plant.effects import presets

SCENARIOS = ("circle_fast", "lemniscate")
PUBLISHED = {"circle_fast": 0.038, "lemniscate": 0.049}  # [m] a peer's bare S-500 with PX4
LONGEST_SHIFT = 0.5  # [s]


def rms(error: np.ndarray) -> float:
    """Return the RMS length of errors (ticks, 3) [m]."""
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


def figures(series: Series) -> tuple[float, float, float, float]:
    """Return RMSE in time, RMSE after the shift, the shift [s], RMS distance to the path."""
    flown = np.flatnonzero(series.in_phase("trajectory"))
    truth, reference = (
        np.column_stack([series[f"{block}.{axis}"] for axis in "xyz"])
        for block in ("truth", "reference")
    )
    ticks = range(round(LONGEST_SHIFT / 0.004))
    # a shift beyond the trajectory's begin compares with the reference before it
    shifted = [rms(truth[flown] - reference[np.maximum(flown - k, 0)]) for k in ticks]
    best = int(np.argmin(shifted))
    path = reference[flown][::5]
    nearest = [np.min(np.sum((path - point) ** 2, axis=1)) for point in truth[flown][::10]]
    return shifted[0], shifted[best], 0.004 * best, float(np.sqrt(np.mean(nearest)))


def main() -> None:
    """Fly, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--profiles", nargs="+", default=["px4_position", "s500"])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    options = parser.parse_args()
    print("| profile | scenario | plant | seed | in time | shifted by | path | published |")
    print("|---|---|---|---|---|---|---|---|")
    for name in options.profiles:
        profile = load_profile("s500") if name == "s500" else load_profile("s500", name)
        for scenario in SCENARIOS:
            for plant in (presets.CALM, presets.LABORATORY):
                for seed in options.seeds:
                    changes = presets.added({}, presets.read([plant]))
                    trial = Trial(name, profile, 0.0, seed, scenario, vehicle_changes=changes)
                    series = fly(trial).series
                    time, after, shift, path = figures(series)
                    print(
                        f"| `{name}` | `{scenario}` | {plant} | {seed} | {time:.3f} m | "
                        f"{after:.3f} m by {1e3 * shift:.0f} ms | {path:.3f} m | "
                        f"{PUBLISHED[scenario]} m |",
                        flush=True,
                    )


if __name__ == "__main__":
    main()
