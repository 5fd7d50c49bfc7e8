"""Flies one layout of the nodes with measured ticks, and reads what was measured."""

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from uam_lab.experiments.budget.path import TickPath, tick_path, work
from uam_lab.flights.flight_settings import FlightSettings
from uam_lab.flights.library.flight import Flight
from uam_lab.flights.observer import FlightStatus, Observer
from uam_lab.flights.processes.interrupts import StopRequest
from uam_lab.flights.processes.process_table import nodes
from uam_lab.flights.ros.node_arguments import FLYING, TICK_TIMES
from uam_msgs_py.node import wiring
from uam_msgs_py.node.tick_times import read_tick_times

LAYOUTS = SEPARATE, FUSED = ("separate", "fused")
# layout → the way of a tick from the sensors to the setpoint, and the nodes in its last process
PATHS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    SEPARATE: (
        (*(wiring.PLANT, wiring.ESTIMATOR, wiring.POSITION, wiring.ATTITUDE), wiring.BRIDGE),
        (),
    ),
    FUSED: ((wiring.PLANT, wiring.FLIGHT_CONTROLLER), wiring.FUSED),
}
CONTROL = FLYING | {wiring.FLIGHT_CONTROLLER}  # processes of the nodes that fly
PERCENTILES = (50.0, 99.0, 99.9)


class CoreShares(Observer):
    """Measures the cores that each process of a flight uses, from take-off to landing.

    It passes the progress on to another observer.
    """

    def __init__(self, observer: Observer) -> None:
        self._observer = observer
        self._begun: dict[str, tuple[float, float]] = {}  # name → wall time, processor time [s]
        self._newest: dict[str, tuple[float, float]] = {}
        self.message, self.started = observer.message, observer.started
        self.bring_up, self.finish = observer.bring_up, observer.finish

    def update(self, status: FlightStatus) -> None:
        """Sample in flight."""
        if status.time >= 0.0 and not status.done:
            self._newest = spent()
            self._begun = self._begun or self._newest
        self._observer.update(status)

    @property
    def shares(self) -> dict[str, float]:
        """Return process → cores, its processor time per wall time."""
        found = {}
        for name, (end, used) in self._newest.items():
            begin, before = self._begun.get(name, (end, used))
            if end > begin:
                found[name] = (used - before) / (end - begin)
        return found


def spent() -> dict[str, tuple[float, float]]:
    """Return node of this program's flight → wall time, processor time so far [s]."""
    found = {}
    for process, name in nodes(psutil.Process().children(recursive=True)).items():
        try:
            used = process.cpu_times()
        except psutil.Error:  # ended meanwhile
            continue
        found[name] = time.monotonic(), used.user + used.system
    return found


@dataclass(frozen=True)
class Budget:
    """What a flight measured. The plant measures the latency; there is none in lockstep."""

    layout: str
    clock: str
    folder: Path
    path: TickPath
    work: dict[str, dict[str, float]]  # node → part → mean time per tick [ms]
    latency: np.ndarray  # (ticks,) [ms] from publication of the sensors to that of the setpoint
    missed: int  # setpoints that came more than three control periods late or never
    ticks: int  # all setpoints
    pace: float  # simulated time per wall time
    cores: dict[str, float] = field(default_factory=dict)  # process → cores in flight
    failure: str = ""  # "" for a completed flight

    @property
    def figures(self) -> dict[str, float]:
        """Return p50, p99, p99.9 and max of the latency [ms]; in lockstep of the path."""
        values = self.latency if len(self.latency) else self.path.totals
        found = {f"p{q:g}": float(np.percentile(values, q)) for q in PERCENTILES}
        return found | {"max": float(values.max())}

    @property
    def missed_share(self) -> float:
        """Return the share of missed ticks [1]."""
        return self.missed / self.ticks if self.ticks else 0.0

    @property
    def control_cores(self) -> float:
        """Return the cores of the processes that fly, the plant and the recorder excluded."""
        return sum(share for name, share in self.cores.items() if name in CONTROL)


def fly(layout: str, settings: FlightSettings, observer: Observer, stop: StopRequest) -> Budget:
    """Fly settings with `tick_times`; return a budget. Raises NoTicks and what a flight raises."""
    shares = CoreShares(observer)
    with Flight(checked=settings, observer=shares, stop=stop) as flight:
        result = flight.wait()
    failure = result.outcome.failure or ("" if result.completed else result.reason)
    return read(layout, result.folder, settings.clock, shares.shares, failure)


def read(
    layout: str, folder: Path, clock: str, cores: Mapping[str, float], failure: str = ""
) -> Budget:
    """Return the budget from the folder of a flight. Raises NoTicks."""
    logs = folder / "logs"
    measured = {file.stem: read_tick_times(file) for file in (logs / TICK_TIMES).glob("*.npz")}
    way, inside = PATHS[layout]
    plant: dict[str, Any] = json.loads((logs / "mujoco_sim.json").read_text(encoding="utf-8"))
    return Budget(
        layout=layout,
        clock=clock,
        folder=folder,
        path=tick_path(way, measured, inside),
        work={node: work(one) for node, one in sorted(measured.items()) if len(one["stamp"])},
        latency=1e3 * np.array(plant["latency_s"]),
        missed=plant["missed_ticks"],
        ticks=plant["answerable_ticks"],
        pace=plant["simulated_s"] / max(plant["wall_s"], 1e-9),
        cores=dict(cores),
        failure=failure,
    )
