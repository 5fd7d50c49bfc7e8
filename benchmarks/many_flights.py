"""What Dask costs, and whether a disturbed campaign gives the same table.

    .venv/bin/python benchmarks/many_flights.py                           # 40 flights, twice
    .venv/bin/python benchmarks/many_flights.py --scenario hover --flights 12
    .venv/bin/python benchmarks/many_flights.py --disturbed               # 40 flights, twice
    .venv/bin/python benchmarks/many_flights.py --disturbed --scheduled --flights 10000 \\
        --scenario benchmarks/hop.yaml                                    # an hour

The first form flies in turns in this process and on one worker, in blocks of the same flights, and
prints the ratio of the times. --disturbed flies a campaign in peace and one in which two workers
are killed and Ctrl-C comes once, and compares the tables byte by byte; --scheduled flies it a third
time, in the same way, on two workers of a scheduler of their own. Exit status 1: tables differ.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
from distributed import LocalCluster

from uam_control.profiles.profile import load_profile
from uam_lab.experiments.campaign.variations import Draws, ranges
from uam_lab.experiments.trials.trial import measure
from uam_lab.experiments.workers.place import Workplace
from uam_lab.experiments.workers.workers import workers
from uam_lab.flights.direct.warm_up import prepare

BLOCKS = 4  # turns of loop and worker, so that both see the same machine
WORKER = "dask worker"  # title of a worker process
POLL = 0.5  # [s]


def overhead(options) -> int:
    """Print the time of a flight in a loop, that by a worker, and their ratio."""
    draws = Draws(load_profile("s500"), options.flights, 1, ranges(), options.scenario)
    trials = list(draws)
    prepare()
    begun = time.perf_counter()
    with workers(Workplace(1), prepare) as crew:
        list(crew.completed(measure, trials[:1]))
        measure(trials[0])
        started = time.perf_counter() - begun
        loop = by_worker = 0.0
        for k in range(BLOCKS):
            block = trials[k::BLOCKS]
            begun = time.perf_counter()
            for trial in block:
                measure(trial)
            loop += time.perf_counter() - begun
            begun = time.perf_counter()
            list(crew.completed(measure, block))
            by_worker += time.perf_counter() - begun
    count = len(trials)
    print(f"loop      {loop / count:.3f} s per flight ({count} flights of {options.scenario})")
    print(f"worker    {by_worker / count:.3f} s per flight")
    print(f"ratio     {by_worker / loop:.3f}")
    print(f"start     {started:.1f} s, once, with one flight on each side")
    return 0


def disturbed(options) -> int:
    """Compare the tables of disturbed campaigns with that of an undisturbed one."""
    with tempfile.TemporaryDirectory() as folder:
        peaceful, other, third = (Path(folder) / name for name in ("peaceful", "other", "third"))
        with _told("in peace", options, peaceful) as command:
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        with _told("disturbed", options, other) as command:
            _disturb(command)
        tables = [_table(other)]
        if options.scheduled:
            with (
                _told("scheduler", options, third) as command,
                LocalCluster(
                    n_workers=2, threads_per_worker=1, host="127.0.0.1", silence_logs=50
                ) as cluster,
            ):
                _disturb([*command, "--scheduler", cluster.scheduler_address], os.getpid())
            tables.append(_table(third))
        same = all(table == _table(peaceful) for table in tables)
    print(f"two workers killed, one Ctrl-C, {options.flights} flights: same table: {same}")
    return 0 if same else 1


@contextmanager
def _told(name: str, options, out: Path) -> Iterator[list[str]]:
    """Give the command of the campaign to `out`; print the time of the block, and the size."""
    begun = time.perf_counter()
    yield _command(options, out)
    seconds = time.perf_counter() - begun
    size = len(_table(out)) / options.flights
    rate = f"{options.flights / seconds:.1f} flights/s"
    print(f"{name:<9} {seconds:.0f} s, {rate}, {size:.0f} B per flight", flush=True)


def _command(options, out: Path) -> list[str]:
    flights = ["--flights", str(options.flights), "--scenario", options.scenario]
    return [sys.executable, "-m", "uam_lab.cli.main", "campaign", *flights, "--out", str(out)]


def _table(out: Path) -> bytes:
    return (out / "flights.parquet").read_bytes()


def _disturb(command: list[str], owner: int | None = None) -> None:
    """Kill two workers, end by Ctrl-C, start again and wait. owner: process of the workers."""
    out = Path(command[command.index("--out") + 1])
    with subprocess.Popen(command, start_new_session=True, stderr=subprocess.DEVNULL) as first:
        for _ in range(2):
            _wait_for_rows(out, first)
            victim = _workers(owner or first.pid)[-1]
            print(f"kill      worker {victim.pid}", flush=True)
            victim.kill()
            time.sleep(2 * POLL)
        _wait_for_rows(out, first)
        if first.poll() is None:
            print("Ctrl-C", flush=True)
            os.killpg(first.pid, signal.SIGINT)
        begun = time.monotonic()
        first.wait()
        print(f"ended     after {time.monotonic() - begun:.1f} s, status {first.returncode}")
    subprocess.run(command, check=True)


def _wait_for_rows(out: Path, process: subprocess.Popen) -> None:
    """Wait until a part more is written, or the campaign ends."""
    known = len(list(out.glob("flights.parts/*.parquet")))
    while process.poll() is None and len(list(out.glob("flights.parts/*.parquet"))) <= known:
        time.sleep(POLL)


def _workers(owner: int) -> list[psutil.Process]:
    children = psutil.Process(owner).children(recursive=True)
    return [one for one in children if any(WORKER in part for part in one.cmdline())]


def main() -> int:
    """Run the chosen form; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    option = parser.add_argument
    option("--flights", type=int, default=40, help="(default %(default)s)")
    option("--scenario", default="pick_and_place", help="(default %(default)s)")
    option("--disturbed", action="store_true", help="compare tables instead of times")
    option(
        "--scheduled",
        action="store_true",
        help="with --disturbed: a third campaign, by a scheduler's workers",
    )
    options = parser.parse_args()
    return disturbed(options) if options.disturbed else overhead(options)


if __name__ == "__main__":
    sys.exit(main())
