"""Measure real-time flights on a machine under load.

    .venv/bin/python benchmarks/load.py                        # every condition, some minutes
    .venv/bin/python benchmarks/load.py --only "one core"      # one of them

It flies the same short mission under each condition of loading/conditions.py. The table also gives
each number relative to the flight without load of the same run. Writes load.json and load.md to
--out; the exit status is 1 if a vehicle was lost.
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
    """Fly and print the table; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    option = parser.add_argument
    option(
        "--only",
        action="append",
        choices=[one.name for one in CONDITIONS],
        help="condition to fly besides the flight without load; may be repeated",
    )
    option("--fused", action="store_true", help="control nodes in one process")
    option("--out", type=Path, default=Path("results/load"), help="(default %(default)s)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    first, *others = CONDITIONS
    chosen = [first, *(one for one in others if not options.only or one.name in options.only)]
    found = []
    try:
        for condition in chosen:
            print(f"load: {condition.name}", flush=True)
            found.append(flight.fly(condition, options.out, options.fused))
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
