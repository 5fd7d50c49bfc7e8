"""CPU and memory of each node of a running flight: what a companion computer needs.

    python benchmarks/companion_load.py [--seconds 30]

Run it beside `uam vehicle` or `uam rehearse`, in the phase that matters. Cores are processor time
per wall time.
"""

from __future__ import annotations

import argparse
import sys
import time

import psutil
from rich.console import Console
from rich.table import Table

from uam_lab.flights.processes.process_table import nodes


def main() -> int:
    """Measure and print; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=30.0, metavar="S")
    seconds = parser.parse_args().seconds
    found = nodes(psutil.process_iter())
    if not found:
        print("no flight runs: start uam vehicle or uam rehearse", file=sys.stderr)
        return 2
    begun, before = time.monotonic(), {one: _spent(one) for one in found}
    time.sleep(seconds)
    elapsed = time.monotonic() - begun
    table, total = Table("node", "cores", "memory [MB]", title=f"{elapsed:.0f} s"), 0.0
    for process, name in found.items():
        if not process.is_running():
            continue
        cores = (_spent(process) - before[process]) / elapsed
        total += cores
        table.add_row(name, f"{cores:.3f}", f"{process.memory_info().rss / 1e6:.0f}")
    table.add_row("all", f"{total:.3f}", "")
    Console().print(table)
    return 0


def _spent(process: psutil.Process) -> float:
    """Return the processor time [s] of a process so far."""
    times = process.cpu_times()
    return times.user + times.system


if __name__ == "__main__":
    raise SystemExit(main())
