"""Flies the layouts and returns the values: pace, latency, and flights on a busy machine."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from loading.conditions import CONDITIONS, under

from layout_targets.targets import BUSY, CORES, MISSED, P50, P99, PACE, Value
from uam_lab.records.results.result_folder import new_folder
from uam_sim_bridge.ports import INSTANCES, ports_of

UAM = (sys.executable, "-m", "uam_lab.cli.main")
INSTANCE = INSTANCES - 1
HOGS = next(one for one in CONDITIONS if one.name == "every core has a hog")


def lockstep(layouts: tuple[str, ...], flights: int, out: Path) -> Iterator[Value]:
    """Yield the pace of pick-and-place, the best of `flights`; start and report timed apart."""
    for layout in layouts:
        best, folder = 0.0, out
        for _ in range(flights):
            folder = new_folder(out, f"lockstep_{layout}")
            begun = time.monotonic()
            _uam("fly", "--no-report", *_fused(layout), "--out", str(folder), log=folder)
            whole = time.monotonic() - begun
            plant = json.loads((folder / "logs" / "mujoco_sim.json").read_text())
            best = max(best, plant["simulated_s"] / plant["wall_s"])
            print(f"layouts: {layout}, {plant['simulated_s'] / plant['wall_s']:.2f} x", flush=True)
        begun = time.monotonic()
        _uam("report", str(folder), log=folder)
        yield Value(layout, PACE, best)
        yield Value(layout, "start, and reading of the log [s]", whole - plant["wall_s"])
        yield Value(layout, "report with video [s]", time.monotonic() - begun)


def realtime(layouts: tuple[str, ...], minutes: float, out: Path) -> Iterator[Value]:
    """Yield latency, missed ticks and cores of `uam budget`."""
    for layout in layouts:
        folder = new_folder(out, f"realtime_{layout}")
        _uam(
            *("budget", "--minutes", str(minutes), "--layout", layout, "--out", str(folder)),
            log=folder,
        )
        found = json.loads((folder / "budget.json").read_text())["layouts"][layout]
        latency = found["latency_ms"]
        yield Value(layout, P50, latency["p50"])
        yield Value(layout, P99, latency["p99"])
        yield Value(layout, "latency p99.9 [ms]", latency["p99.9"])
        yield Value(layout, "latency max [ms]", latency["max"])
        yield Value(layout, MISSED, 100.0 * found["missed_share"])
        yield Value(layout, CORES, found["control_cores"])


def busy(layouts: tuple[str, ...], flights: int, out: Path) -> Iterator[Value]:
    """Yield the share of real-time flights that are completed beside a busy process per core."""
    for layout in layouts:
        completed = 0
        for number in range(flights):
            folder = new_folder(out, f"busy_{layout}")
            options = ("--scenario", "quick_pick", "--clock", "realtime", "--no-report")
            own = ("--seed", str(number + 1), "--instance", str(INSTANCE), "--out", str(folder))
            with under(HOGS, folder, ports_of(INSTANCE).domain):
                status = _uam("fly", *options, *own, *_fused(layout), log=folder, check=False)
            completed += status == 0
            print(f"layouts: {layout}, busy: {completed} of {number + 1}", flush=True)
        yield Value(layout, BUSY, completed / flights)


def _fused(layout: str) -> tuple[str, ...]:
    return ("--fused",) if layout == "fused" else ()


def _uam(*arguments: str, log: Path, check: bool = True) -> int:
    """Run a command of uam; its output goes to a file beside the folder `log`."""
    with log.with_suffix(".txt").open("a") as output:
        run = subprocess.run([*UAM, *arguments], stdout=output, stderr=output, check=False)
    if check and run.returncode:
        raise SystemExit(f"layouts: uam {arguments[0]} failed; see {output.name}")
    return run.returncode
