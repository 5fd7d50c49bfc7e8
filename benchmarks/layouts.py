"""Check the speed of the layouts of the nodes against their targets.

    .venv/bin/python benchmarks/layouts.py                              # all, 35 minutes
    .venv/bin/python benchmarks/layouts.py --only lockstep              # 5 minutes
    .venv/bin/python benchmarks/layouts.py --minutes 1 --flights 1      # to see that it works

lockstep  pick-and-place as fast as it goes: simulated per wall time of the flight itself; start,
          reading of the log, report and video are timed apart
realtime  `uam budget`: latency from the sensors to the setpoint, missed ticks, cores
busy      short missions in real time beside a busy process on every core: are they completed?

Prints value against target and writes layouts.md and layouts.json to --out. The targets are for a
quiet machine with two cores. Exit status 1: a target was missed.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

from layout_targets import measured
from layout_targets.targets import Value, table

from uam_lab.experiments.budget.flown import LAYOUTS

PARTS = ("lockstep", "realtime", "busy")
MISSED, INTERRUPTED = 1, 130


def main() -> int:
    """Fly, print the table; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    option = parser.add_argument
    option("--only", action="append", choices=PARTS, help="may be repeated (default: all)")
    option("--layout", choices=("all", *LAYOUTS), default="all", help="(default %(default)s)")
    text = "of each real-time flight (default %(default)g)"
    option("--minutes", type=float, default=10.0, help=text)
    option("--flights", type=int, default=10, help="beside busy processes (default %(default)d)")
    option("--out", type=Path, default=Path("results/layouts"), help="(default %(default)s)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    layouts = LAYOUTS if options.layout == "all" else (options.layout,)
    parts = {
        "lockstep": lambda: measured.lockstep(layouts, min(3, options.flights), options.out),
        "realtime": lambda: measured.realtime(layouts, options.minutes, options.out),
        "busy": lambda: measured.busy(
            ("fused",) if "fused" in layouts else layouts, options.flights, options.out
        ),
    }
    values: list[Value] = []
    try:
        for part in options.only or PARTS:
            print(f"layouts: {part}", flush=True)
            values += parts[part]()
    except KeyboardInterrupt:
        print("layouts: interrupted", file=sys.stderr)
        return INTERRUPTED
    text = table(values)
    print(text)
    (options.out / "layouts.md").write_text(text + "\n")
    entries = [asdict(one) | {"reached": one.reached} for one in values]
    (options.out / "layouts.json").write_text(json.dumps(entries, indent=1))
    return 0 if all(one.reached for one in values) else MISSED


if __name__ == "__main__":
    raise SystemExit(main())
