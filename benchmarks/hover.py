"""Hover of a vehicle on a plant: how still it stands, and how much later its setpoints may come.

    .venv/bin/python benchmarks/hover.py                    # t650 on t650_mirror, seeds 1 2 3
    .venv/bin/python benchmarks/hover.py --vehicle s500_arm --plant-preset laboratory --seeds 1

Each seed flies the scenario hover_60 in the direct engine: 60 s, from 20 s after take-off on. The
table has the RMS distance of the platform from where it stands on the average, and the distance of
that place from the reference. Then the setpoints come later and later, without the supervisor's
limit, until a hover is not completed: the search halves the interval down to a tick. Exit status 1:
a hover of the table is not completed.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

import numpy as np

from uam_control.profiles.profile import Profile, default_profile
from uam_control.vehicle import load_description
from uam_lab.experiments.trials.trial import Trial, fly, measure
from uam_sim_bridge.plant.effects import presets

HOVER = "hover_60"
LATEST = 0.2  # [s] that the effect adds at most


def stands(trial: Trial) -> tuple[float, float, str]:
    """Fly; return RMS about the mean place, its distance from the reference [mm], the end."""
    done = fly(trial)
    series = done.series
    still = series.in_phase("hover")
    error = np.array([series[f"truth.{axis}"] - series[f"reference.{axis}"] for axis in "xyz"])
    error = 1e3 * error[:, still]
    place = error.mean(axis=1, keepdims=True)
    rms = float(np.sqrt(np.sum(np.square(error - place), axis=0).mean()))
    return rms, float(np.linalg.norm(place)), done.failure or done.abort_reason or "completed"


def delay_margin(profile: Profile, preset: list[str]) -> float:
    """Return the largest delay [s], whole ticks, with which the hover of seed 1 is completed."""
    mission = replace(profile.sets["mission"], delay_margin=1.0)
    free = replace(profile, sets={**profile.sets, "mission": mission})
    tick = profile.vehicle.control_period
    held, lost = 0, round(LATEST / tick)
    while lost - held > 1:
        ticks = (held + lost) // 2
        late = f"network_delay:setpoint={ticks * tick:g},setpoint_jitter=0,mocap=0,mocap_jitter=0"
        changes = presets.added({}, presets.read(preset, (late,)))
        done = measure(Trial("late", free, 0.0, 1, HOVER, vehicle_changes=changes))
        print(f"setpoints {1e3 * ticks * tick:.0f} ms later: {done.outcome}", file=sys.stderr)
        held, lost = (ticks, lost) if done.completed else (held, ticks)
    return held * tick


def main() -> int:
    """Print the table as markdown, and the delay; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vehicle", default="t650")
    parser.add_argument("--plant-preset", nargs="*", metavar="NAME", default=["t650_mirror"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3])
    options = parser.parse_args()
    profile = default_profile("modular", load_description(options.vehicle))
    changes, good = presets.added({}, presets.read(options.plant_preset, ())), True
    print("| seed | RMS without standing offset [mm] | standing offset [mm] | end |")
    print("|---|---|---|---|")
    for seed in options.seeds:
        trial = Trial("hover", profile, 0.0, seed, HOVER, vehicle_changes=changes)
        rms, offset, end = stands(trial)
        good &= end == "completed"
        print(f"| {seed} | {rms:.1f} | {offset:.1f} | {end} |", flush=True)
    found = delay_margin(profile, options.plant_preset)
    model = profile.sets["mission"].delay_margin
    print(f"\nsetpoints may come {1e3 * found:.0f} ms later; by the model {1e3 * model:.0f} ms")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
