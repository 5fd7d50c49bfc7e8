"""Cost as work grows: ticks per second, memory and log against joints, rotors, vehicles, topics.

    .venv/bin/python benchmarks/growth.py                         # all, 25 minutes
    .venv/bin/python benchmarks/growth.py --only joints --minutes 0.5
    .venv/bin/python benchmarks/growth.py --layout separate

Every point is a flight in lockstep through the nodes, as fast as the machine allows; joints and
rotors are flown in the direct engine, too. Vehicles that config/vehicle does not have are derived
from those it has (growing/vehicles.py). `topics`: recorded by a second recorder beside the flight's
own, which records all of them. Writes growth.json, growth.md, growth.png and growth.svg to --out.
Nothing else should run on the machine.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from growing import curves, flights
from growing.flights import NotFlown, Point
from growing.vehicles import with_joints, with_rotors

from uam_lab.experiments.budget.flown import LAYOUTS
from uam_lab.experiments.budget.shuttle import shuttle
from uam_lab.records.results.result_folder import new_folder

SIZES = {"joints": (2, 3, 6), "rotors": (4, 6, 8), "vehicles": (1, 2, 3), "topics": (0, 10, 20, 40)}
FAILED, INTERRUPTED = 1, 130


def main() -> int:
    """Fly, print and draw; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    option = parser.add_argument
    text = "what grows; may be repeated (default: all)"
    option("--only", action="append", choices=tuple(SIZES), help=text)
    option("--layout", choices=("all", *LAYOUTS), default="all", help="(default %(default)s)")
    option("--minutes", type=float, default=1.0, help="of each flight (default %(default)g)")
    option("--out", type=Path, default=Path("results/growth"), help="(default %(default)s)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    layouts = LAYOUTS if options.layout == "all" else (options.layout,)
    points: list[Point] = []
    status = 0
    try:
        for point in _points(options.only or tuple(SIZES), layouts, options.minutes, options.out):
            print(f"growth: {curves.table([point]).splitlines()[-1]}", flush=True)
            points.append(point)
    except NotFlown as error:
        print(f"growth: {error}", file=sys.stderr)
        status = FAILED
    except KeyboardInterrupt:
        print("growth: interrupted", file=sys.stderr)
        status = INTERRUPTED
    if points:
        text = curves.table(points)
        print(text)
        (options.out / "growth.md").write_text(text + "\n")
        (options.out / "growth.json").write_text(json.dumps([*map(asdict, points)], indent=1))
        curves.draw(points, options.out / "growth.png", options.out / "growth.svg")
        print(f"pictures {options.out / 'growth.png'}, growth.svg")
    return status


def _points(
    chosen: tuple[str, ...], layouts: tuple[str, ...], minutes: float, out: Path
) -> Iterator[Point]:
    """Fly and yield the points, curve by curve."""
    scenario = out / "shuttle.yaml"
    scenario.write_text(shuttle(60.0 * minutes, arm=False))
    for what in chosen:
        for layout in layouts:
            for size in SIZES[what]:
                vehicle, counts = _flight(what, size, out / "vehicles")
                folder = new_folder(out / "flights", f"{what}_{size}_{layout}")
                yield flights.through_nodes(what, size, layout, scenario, folder, vehicle, **counts)
        if what in ("joints", "rotors"):
            for size in SIZES[what]:
                vehicle, _ = _flight(what, size, out / "vehicles")
                yield flights.direct(what, size, scenario, vehicle)


def _flight(what: str, size: int, folder: Path) -> tuple[str, dict[str, int]]:
    """Return the vehicle of a point, and what differs from one flight of one vehicle."""
    if what == "joints":
        return with_joints(size, folder), {}
    if what == "rotors":
        return with_rotors(size, folder), {}
    name = {"vehicles": "vehicles", "topics": "further_topics"}[what]
    return "s500_arm", {name: size}


if __name__ == "__main__":
    raise SystemExit(main())
