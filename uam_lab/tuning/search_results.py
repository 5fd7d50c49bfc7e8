"""Results of a search: the best profile as a ROS parameter file, every evaluation, a plot."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
import optuna
import yaml
from matplotlib.figure import Figure

from uam_lab.report.figures import style
from uam_lab.results.atomic import write_rows, write_text
from uam_lab.tuning.search import DONE
from uam_lab.tuning.space import Space

matplotlib.use("Agg")


def write_best(file: Path, space: Space, study: optuna.Study, command: str) -> None:
    """Write the best profile, with its origin as comment at the beginning."""
    best = study.best_trial
    profile = space.profile(best.params, file.stem)
    evaluations = len(study.get_trials(deepcopy=False, states=DONE))
    head = [
        f"Found by: {command}",
        f"Study {study.study_name}: evaluation {best.number} of {evaluations}, cost "
        f"{best.value:.4g} (start {study.trials[0].value:.4g}), from profile {space.start.name}.",
        f"Vehicle: {space.start.vehicle.name}.",
        "Flights of an evaluation: "
        + "; ".join(
            f"{flight['payload_mass']:g} kg seed {flight['seed']}"
            + "".join(f" {k}={v}" for k, v in flight.get("vehicle", {}).items())
            for flight in space.flights
        ),
    ]
    sections = {node: {"ros__parameters": values} for node, values in profile.sections.items()}
    body = yaml.safe_dump(sections, sort_keys=False, default_flow_style=None, width=100)
    write_text(file, "".join(f"# {line}\n" for line in head) + body)


def write_evaluations(file: Path, space: Space, study: optuna.Study) -> None:
    """Write one row per evaluation: number, cost, values of the knobs."""
    names = [knob.name for knob in space.knobs]
    write_rows(
        file,
        ["evaluation", "cost", *names],
        (
            [
                trial.number,
                f"{trial.value:.6g}",
                *(f"{trial.params.get(name, np.nan):.6g}" for name in names),
            ]
            for trial in study.get_trials(deepcopy=False, states=DONE)
        ),
    )


def plot(file: Path, space: Space, study: optuna.Study) -> None:
    """Draw the cost of every evaluation, the best cost so far, and the values of each knob."""
    trials = study.get_trials(deepcopy=False, states=DONE)
    costs = np.array([trial.value for trial in trials])
    columns = 4
    rows = -(-len(space.knobs) // columns)
    with style.styled():
        figure = Figure(figsize=(style.WIDTH, 2.8 + 1.25 * rows), layout="constrained")
        top, bottom = figure.subfigures(2, 1, height_ratios=(2.8, 1.25 * rows))
        axis = top.subplots()
        numbers = np.arange(len(costs))
        axis.plot(numbers, costs, ".", color=style.FLIGHTS[0], alpha=0.5, label="evaluation")
        best_so_far = np.minimum.accumulate(costs)
        axis.step(numbers, best_so_far, where="post", color=style.INK, label="best so far")
        axis.set(yscale="log", xlabel="evaluation", ylabel="cost")
        axis.set_title(
            f"Search {study.study_name}, {space.start.vehicle.name}: {len(costs)} evaluations, "
            f"best {costs.min():.3g}, start {costs[0]:.3g}",
            loc="left",
        )
        axis.legend(loc="upper right")
        for knob, small in zip(space.knobs, bottom.subplots(rows, columns).flat, strict=False):
            values = [trial.params[knob.name] for trial in trials]
            small.scatter(values, costs, s=4, color=style.FLIGHTS[0], alpha=0.4)
            small.axvline(study.best_trial.params[knob.name], color=style.INK, linewidth=0.8)
            small.set(xscale="log", yscale="log", xlim=(knob.low, knob.high))
            small.set_title(knob.name.replace("_controller", ""), fontsize=6.5, loc="left")
            small.tick_params(labelsize=5.5, which="both")
        style.save(figure, file)
