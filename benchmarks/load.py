"""Fly in real time on a machine that is kept busy: what gets worse, in which order.

    .venv/bin/python benchmarks/load.py                        # every condition, some minutes
    .venv/bin/python benchmarks/load.py --only "one core"      # one of them

The same short mission under each condition of loading/conditions.py; every number is also given as
a multiple of that of the flight without load, in the same run. Leaves load.json and load.md in
--out; the exit status is 1 where a vehicle was lost.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

from loading import flight, table
from loading.conditions import CONDITIONS

LOST, INTERRUPTED = 1, 130


def main() -> int:
    """Fly, print; returns the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    option = parser.add_argument
    option(
        "--only",
        action="append",
        choices=[one.name for one in CONDITIONS],
        help="besides the flight without load; may be given again",
    )
    option("--out", type=Path, default=Path("results/load"), help="(default %(default)s)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    first, *others = CONDITIONS
    chosen = [first, *(one for one in others if not options.only or one.name in options.only)]
    found = []
    try:
        for condition in chosen:
            print(f"load: {condition.name}", flush=True)
            found.append(flight.fly(condition, options.out))
    except KeyboardInterrupt:
        print("load: interrupted", file=sys.stderr)
        return INTERRUPTED
    text = table.markdown(found)
    print(text)
    (options.out / "load.md").write_text(text + "\n")
    (options.out / "load.json").write_text(json.dumps([asdict(one) for one in found], indent=1))
    return LOST if any(one.outcome == "lost" for one in found) else 0


if __name__ == "__main__":
    raise SystemExit(main())
