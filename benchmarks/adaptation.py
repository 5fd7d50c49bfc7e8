"""What adaptation buys: laws of equal feedback and margin over varied flights.

    .venv/bin/python benchmarks/adaptation.py               # tables.md, flights.csv, figures
    .venv/bin/python benchmarks/adaptation.py --part arm    # a part; the same --out continues
    .venv/bin/python benchmarks/adaptation.py --part varied --condition nominal hard --engine ros
    .venv/bin/python benchmarks/adaptation.py --design      # the strengths that the margins allow
    .venv/bin/python benchmarks/adaptation.py --tune 240    # the search, N evaluations per law

docs/adaptation.md has the results; adapting/study.yaml everything that is flown.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from dataclasses import replace
from functools import partial
from itertools import accumulate
from pathlib import Path

from adapting import design, figures, report
from adapting.description import STUDY, Study, load_study
from adapting.run import PROPOSED, SHOWN, Runner, margins
from adapting.search import PATIENCE, search

from uam_control.settings.atomic import write_rows, write_text
from uam_lab.experiments.tuning.front import convergence
from uam_lab.experiments.workers.place import Workplace, cores
from uam_lab.records.results.result_folder import make_folder, read_json, versions, write_json
from uam_lab.records.results.terminal import say
from uam_lab.records.results.timeseries import SUBSYSTEMS
from uam_lab.report.figures import style

PARTS = ("margins", "varied", "law", "arm")
TUNING = "tuning.json"  # of `--tune`: law → costs of the evaluations, best numbers


def _tune(study: Study, evaluations: int, out: Path) -> None:
    file = out / TUNING
    done = read_json(file) if file.exists() else {}
    for law in study.document["ranges"]:
        if len(done.get(law, {}).get("costs", ())) == evaluations:
            continue  # of a search that was stopped
        strength, folder = study.document["strengths"], out / "scenarios"
        found = search(study, law, strength, evaluations, folder, say)
        done[law] = {"costs": found.costs, "best": found.best}
        write_json(file, done)
    with style.styled():
        costs = {law: one["costs"] for law, one in done.items()}
        style.save(figures.tuning(costs), out / "tuning.png")
    for law, one in done.items():
        say(f"{law}: cost {one['costs'][0]:.4g} to {min(one['costs']):.4g}: {one['best']}")
        say(f"  {convergence(list(accumulate(one['costs'], min)), PATIENCE)}")


def _fly(study: Study, options: argparse.Namespace, out: Path) -> None:

    parts = options.part
    texts, said, drawn, flown = [], [], {}, []
    seeds = options.seeds or study.document["seeds"]
    runner = Runner(study, out, Workplace(options.jobs), seeds, options.engine)
    if "margins" in parts:
        rows = [row for row in study.rows if row.law and not row.profiles]
        texts.append(report.margin_table(margins(study, rows, runner.converged())))
    if "varied" in parts:
        results = runner.varied(options.condition)
        flown += results
        flown_in = {one.condition for one in results}
        shown = replace(study, conditions=tuple(c for c in study.conditions if c.label in flown_in))
        said = report.sentences(shown, results)
        texts += [report.error_table(shown, results, name) for name in SUBSYSTEMS]
        texts += [report.share_table(shown, results, name) for name in SHOWN if name in flown_in]
        texts.append(report.shares_by_condition(shown, results, PROPOSED))
        drawn["errors"] = lambda: figures.errors(study, results)
        if SHOWN[0] in flown_in:
            drawn["shares"] = lambda: figures.shares(study, results, SHOWN[0])
    for name, fly in (("law", runner.law_sweep), ("arm", runner.arm_sweep)):
        if name in parts:
            swept = fly()
            flown += [one.result for one in swept]
            texts.append(report.sweep_table(swept, {"law": "varied", "arm": "row"}[name]))
            drawn[name] = partial(getattr(figures, name), swept)
    with style.styled():
        for name, draw in drawn.items():
            style.save(draw(), out / f"{name}.png")
    text = "\n\n".join([*texts, "\n".join(f"- {one}" for one in said)]).strip() + "\n"
    command = shlex.join(sys.argv)
    made = f"\nStudy {study.name}, vehicle {study.vehicle.name}. Made by `{command}`.\n"
    write_text(out / "tables.md", text + made)
    write_rows(
        out / "flights.csv",
        ("row", "condition", "seed", "position_m", "attitude_deg", "arm_deg", "outcome"),
        ([r.row, r.condition, r.seed, *(f"{e:.6g}" for e in r.errors), r.outcome] for r in flown),
    )
    write_json(
        out / "study.json",
        {"command": command, "versions": versions(), "study": study.document},
    )
    say(text)


def main() -> int:
    """Design, tune or fly the study; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    option = parser.add_argument
    option("study", nargs="?", type=Path, default=STUDY, help="another study (default: study.yaml)")
    option("--part", nargs="+", choices=PARTS, default=PARTS, help="(default: all)")
    option("--condition", nargs="+", default=(), help="of the part varied (default: all)")
    option("--seeds", type=int, help="seeds 1..N (default: the study's)")
    option("--engine", choices=("direct", "ros"), default="direct", help="(default %(default)s)")
    option("--jobs", type=int, default=cores(), help="processes (default: one per core)")
    option("--design", action="store_true", help="only find the strengths")
    option("--tune", type=int, help="only search the adaptation's numbers, N evaluations per law")
    option("--out", type=Path, default=Path("results/adaptation"), help="(default %(default)s)")
    options = parser.parse_args()
    study = load_study(options.study)
    known = [one.label for one in study.conditions]
    if strange := set(options.condition) - set(known):
        parser.error(f"--condition: no {', '.join(strange)}; there are: {', '.join(known)}")
    out = make_folder(options.out)
    if options.design:
        found = design.strengths(study, say)
        write_json(out / "strengths.json", found)
        say(f"strengths  {json.dumps(found)}")
    elif options.tune:
        _tune(study, options.tune, out)
    else:
        _fly(study, options, out)
    say(f"results  {out}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
