"""Fly Table I as its authors probably flew it, and put its errors beside the paper's.

    .venv/bin/python benchmarks/table1.py                   # as flown, and one change at a time
    .venv/bin/python benchmarks/table1.py --only flown --seeds 20
    .venv/bin/python benchmarks/table1.py --only baselines  # their published gains are unknown
    .venv/bin/python benchmarks/table1.py --only search     # every combination of assumptions
    .venv/bin/python benchmarks/table1.py --only deviations # what s500 adds to the printed law
    .venv/bin/python benchmarks/table1.py --only flown --engine ros --seeds 2

The mission is the paper's, with a payload of 0.2 kg. The profile is paper_table1_as_flown; what it
assumes and the other readings stand in table1_flights/assumptions.yaml. `deviations` flies s500
with each change of deviations.yaml instead. Rows: root mean square over the seeds. Writes table1.md
and a picture of the part flown to --out. docs/law.md has the tables of `flown` and `deviations`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from table1_flights import flights, picture, table

from uam_lab.experiments.trials.experiment import flown_by
from uam_lab.experiments.trials.trial import Trial
from uam_lab.experiments.workers.place import Workplace, cores

PAYLOAD = 0.2  # [kg], the paper's
SHOWN = 6  # rows of the search


def fly(rows, options) -> list[table.Flown]:
    """Fly every row with every seed."""
    seeds = range(1, options.seeds + 1)
    trials = [
        Trial(
            row.label,
            row.profile,
            PAYLOAD,
            seed,
            vehicle_changes=row.vehicle,
            engine=options.engine,
        )
        for row in rows
        for seed in seeds
    ]

    results = [None] * len(trials)
    for done, (number, result) in enumerate(flown_by(Workplace(options.jobs), trials), 1):
        results[number] = result
        print(f"\r{done} of {len(trials)} flights", end="", flush=True)
    print()
    grouped = [results[i * len(seeds) : (i + 1) * len(seeds)] for i in range(len(rows))]
    return [
        table.Flown(row, np.array([r.rms for r in own]), tuple(r.outcome for r in own))
        for row, own in zip(rows, grouped, strict=True)
    ]


def flown(options) -> str:
    """Return the table of the profile itself, and of throttle scales fitted to the plant."""
    found = fly([flights.as_flown(), *flights.fitted()], options)
    labelled = [(one.row.label, one) for one in found]
    picture.draw(labelled, options.out / "table1.svg")
    return table.beside_the_paper(labelled)


def baselines(options) -> str:
    """Return the table of the reconstructed baselines in the same reading."""
    found = fly(flights.baselines(), options)
    return table.beside_the_paper([(f"{one.row.label} (reconstruction)", one) for one in found])


def sensitivity(options) -> str:
    """Return the table with one assumption changed at a time."""
    return table.one_by_one(fly([flights.as_flown(), *flights.sensitivity()], options))


def readme(options) -> str:
    """Return the line of the README: the flying profile."""
    (one,) = fly([flights.flying()], options)
    cells = ("{:.3f}  {:.3f}  {:.3f}", "{:.2f}  {:.2f}  {:.2f}", "{:.2f}  {:.2f}")
    return f"| this simulated flight | {' | '.join(cells)} |".format(*one.mean)


def deviations(options) -> str:
    """Return the table of the flying profile with one addition to the printed law removed each."""
    return table.one_by_one(fly([flights.flying(), *flights.deviations()], options))


def search(options) -> str:
    """Return the nearest of all combinations."""
    return table.best(fly(flights.search(), options), SHOWN)


PARTS = {
    "flown": flown,
    "sensitivity": sensitivity,
    "search": search,
    "baselines": baselines,
    "deviations": deviations,
    "readme": readme,
}


def main() -> int:
    """Fly and print the tables; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    option = parser.add_argument
    text = "part to fly (default: flown and sensitivity); may be repeated"
    option("--only", action="append", choices=tuple(PARTS), help=text)
    option("--seeds", type=int, default=3, help="seeds 1..N (default %(default)s)")
    option("--engine", choices=("direct", "ros"), default="direct", help="(default %(default)s)")
    option("--jobs", type=int, default=cores(), help="processes (default: one per core)")
    option("--out", type=Path, default=Path("results/table1"), help="(default %(default)s)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    texts = [
        f"## {name}\n\n{PARTS[name](options)}\n"
        for name in options.only or ("flown", "sensitivity")
    ]
    text = "\n".join(texts)
    print(text)
    (options.out / "table1.md").write_text(text)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
