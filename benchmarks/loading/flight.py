"""One flight under a load condition, and its result."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from loading.conditions import Condition, under
from uam_lab.experiments.trials.outcome import classify
from uam_lab.records.results import timeseries
from uam_lab.records.results.result_folder import in_a_name, new_folder
from uam_sim_bridge.ports import INSTANCES, ports_of

SCENARIO = "quick_pick"
INSTANCE = INSTANCES - 1  # fixed, so that the listeners have its ROS domain


@dataclass(frozen=True)
class Measured:
    """latency [ms]: median and 99th percentile; missed: control ticks, of those with a sample.

    pace: simulated / wall time. position [m]: largest RMS error of an axis. causes: causes of holds
    and landings, and unmet criteria of a completed mission.
    """

    condition: str
    outcome: str
    latency_p50: float
    latency_p99: float
    missed: int
    ticks: int
    pace: float
    position: float
    lost_messages: int
    causes: str


def fly(condition: Condition, out: Path, fused: bool = False) -> Measured:
    """Fly in real time; the folder of the flight is in `out`."""
    folder = new_folder(out, in_a_name(condition.name))
    command = [sys.executable, "-m", "uam_lab.cli.main", "fly", "--scenario", SCENARIO]
    command += ["--clock", "realtime", "--no-video", "--instance", str(INSTANCE)]
    command += ["--fused"] if fused else []
    with (
        under(condition, out, ports_of(INSTANCE).domain),
        (out / f"{folder.name}.txt").open("w") as output,
    ):
        subprocess.run([*command, "--out", str(folder)], stdout=output, stderr=output, check=False)
    return measured(condition.name, folder)


def measured(name: str, folder: Path) -> Measured:
    """Return the result from the files of the flight."""
    plant = json.loads((folder / "logs" / "mujoco_sim.json").read_text())
    recorder = json.loads((folder / "logs" / "recorder.json").read_text())
    metrics = json.loads((folder / "metrics.json").read_text())
    latency = 1e3 * np.array(plant["latency_s"])
    causes = [one["cause"] for one in metrics["transitions"] if one["to"] in ("holding", "landing")]
    unplanned = [cause for cause in causes if cause != "as planned"]
    return Measured(
        condition=name,
        outcome=classify(timeseries.read(folder / "timeseries.parquet"), metrics),
        latency_p50=float(np.percentile(latency, 50)),
        latency_p99=float(np.percentile(latency, 99)),
        missed=plant["missed_ticks"],
        ticks=plant["answerable_ticks"],
        pace=plant["simulated_s"] / plant["wall_s"],
        position=max(metrics["rms"]["position_m"]),
        lost_messages=sum(recorder["lost"].values()),
        causes="; ".join([*unplanned, *metrics["shortfalls"]]),
    )
