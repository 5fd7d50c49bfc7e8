"""What motion capture, odometry and the velocity of the joints cost: errors of flights.

    python benchmarks/poses.py [--scenarios hover arm_motions circle] [--seeds 1] [--only TEXT]

The table has, over the whole flight of the direct engine, RMS: distance of the true position from
the reference; of the estimate from the reference, which is all that an odometry can promise; angle
of the arm. Results: docs/plant.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from uam_control.profiles.profile import load_profile
from uam_lab.experiments.trials.trial import Trial, fly
from uam_lab.records.results.timeseries import Series
from uam_sim_bridge.plant.effects import presets

RATES = (30, 60, 120, 240, 360)  # Hz
LATE = ("joint_readings",)
# name of the row, presets, effects, parameters of the estimator
ROWS: tuple[tuple[str, Sequence[str], Sequence[str], dict], ...] = (
    *((f"motion capture, {rate} Hz", (), (f"mocap_feed:rate={rate}",), {}) for rate in RATES),
    ("odometry, without drift and jumps", ("odometry",),
     ("odometry_drift:walk=0,turn=0,jumps=0",), {}),
    ("odometry", ("odometry",), (), {}),
    ("joint velocity 48 ms late, `reported`", (), LATE, {}),
    ("the same, `observer`", (), LATE, {"joint_velocity": "observer"}),
    ("joint velocity in time, `reported`", (), (), {}),
    ("the same, `observer`", (), (), {"joint_velocity": "observer"}),
)  # fmt: skip


def distance(series: Series, block: str, flown: np.ndarray) -> float:
    """Return the RMS distance [mm] of a block's position from the reference."""
    apart = [series[f"{block}.{axis}"] - series[f"reference.{axis}"] for axis in "xyz"]
    return 1e3 * float(np.sqrt(np.sum(np.square(np.array(apart)[:, flown]), axis=0).mean()))


def main() -> None:
    """Fly, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenarios", nargs="+", default=["hover", "arm_motions", "circle"])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--only", default="", help="rows whose name contains this text")
    options = parser.parse_args()
    print("| source | scenario | seed | outcome | true position | estimate | arm |")
    print("|---|---|---|---|---|---|---|")
    usual = load_profile("s500")
    joints = usual.vehicle.joint_names
    for name, of, effects, parameters in ROWS:
        estimator = replace(usual.sets["state_estimator"], **parameters)
        profile = replace(usual, sets={**usual.sets, "state_estimator": estimator})
        changes = presets.added({}, presets.read(of, effects))
        for scenario in options.scenarios if options.only in name else ():
            for seed in options.seeds:
                done = fly(Trial(name, profile, 0.0, seed, scenario, vehicle_changes=changes))
                series = done.series
                flown = series.flown
                true, own = (distance(series, one, flown) for one in ("truth", "estimate"))
                arm = np.degrees(
                    [series[f"estimate.{j}"] - series[f"reference.{j}"] for j in joints]
                )
                angle = float(np.sqrt(np.sum(np.square(arm[:, flown]), axis=0).mean()))
                outcome = done.failure or done.abort_reason or "completed"
                print(
                    f"| {name} | `{scenario}` | {seed} | {outcome} | {true:.1f} mm | "
                    f"{own:.1f} mm | {angle:.2f} deg |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
