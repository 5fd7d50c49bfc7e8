"""`uam compare --study`: laws of equal feedback and margin over varied flights."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from functools import partial
from itertools import accumulate
from pathlib import Path

from uam_lab.cli.command import place_of
from uam_lab.experiments.study.description import Study, load_study
from uam_lab.flights.conclude import command_line
from uam_lab.flights.flight_settings import SettingsError, require_ros
from uam_lab.records.results.atomic import write_rows, write_text
from uam_lab.records.results.result_folder import make_folder, read_json, versions, write_json
from uam_lab.records.results.terminal import say
from uam_lab.report.figures import style

PARTS = ("margins", "varied", "law", "arm")
TUNING = "tuning.json"  # of `--tune`: law → costs of the evaluations, best numbers


def run(options: argparse.Namespace) -> int:
    """Design, tune or fly the study; return the exit status."""
    from uam_lab.experiments.study import design

    study = load_study(options.study)
    labels = [one.label for one in study.conditions]
    for label in options.condition or ():
        if label not in labels:
            raise SettingsError(f"--condition '{label}': unknown; there are: {', '.join(labels)}")
    if options.engine == "ros":
        require_ros()
    out = make_folder(options.out, "study", study.name)
    if options.design:
        found = design.strengths(study, lambda text: say(text))
        write_json(out / "strengths.json", found)
        say(f"strengths  {json.dumps(found)}\nresults    {out}")
        return 0
    if options.tune:
        return _tune(study, options.tune, out)
    return _fly(study, options, out)


def _tune(study: Study, evaluations: int, out: Path) -> int:
    from uam_lab.experiments.study import figures
    from uam_lab.experiments.study.search import PATIENCE, search
    from uam_lab.experiments.tuning.convergence import in_words as convergence

    file = out / TUNING
    done = read_json(file) if file.exists() else {}
    for law in study.document["ranges"]:
        if len(done.get(law, {}).get("costs", ())) == evaluations:
            continue  # of a search that was stopped
        found = search(
            study,
            law,
            study.document["strengths"],
            evaluations,
            out / "scenarios",
            lambda text: say(text),
        )
        done[law] = {"costs": found.costs, "best": found.best}
        write_json(file, done)
    with style.styled():
        costs = {law: one["costs"] for law, one in done.items()}
        style.save(figures.tuning(costs), out / "tuning.png")
    for law, one in done.items():
        say(f"{law}: cost {one['costs'][0]:.4g} to {min(one['costs']):.4g}: {one['best']}")
        say(f"  {convergence(list(accumulate(one['costs'], min)), PATIENCE)}")
    say(f"results  {out}")
    return 0


def _fly(study: Study, options: argparse.Namespace, out: Path) -> int:
    from uam_lab.experiments.study import figures, report
    from uam_lab.experiments.study.run import PROPOSED, SHOWN, Runner, margins
    from uam_lab.records.results.timeseries import SUBSYSTEMS

    parts = tuple(options.part or PARTS)
    texts, said, drawn, flown = [], [], {}, []
    seeds = options.seeds or study.document["seeds"]
    runner = Runner(study, out, place_of(options), seeds, options.engine)
    if "margins" in parts:
        rows = [row for row in study.rows if row.law and not row.profiles]
        texts.append(report.margin_table(margins(study, rows, runner.converged())))
    if "varied" in parts:
        results = runner.varied(options.condition or ())
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
    made = f"\nStudy {study.name}, vehicle {study.vehicle.name}. Made by `{command_line()}`.\n"
    write_text(out / "tables.md", text + made)
    write_rows(
        out / "flights.csv",
        ("row", "condition", "seed", "position_m", "attitude_deg", "arm_deg", "outcome"),
        ([r.row, r.condition, r.seed, *(f"{e:.6g}" for e in r.errors), r.outcome] for r in flown),
    )
    write_json(
        out / "study.json",
        {"command": command_line(), "versions": versions(), "study": study.document},
    )
    say(text)
    say(f"results  {out}")
    return 0
