"""Results of a search: the best profile as a ROS parameter file, every evaluation, a plot."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import optuna
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from optuna.trial import FrozenTrial

from uam_control.settings.atomic import write_rows, write_text
from uam_control.settings.parameter_file import as_text
from uam_lab.experiments.tuning.front import chosen, front, hypervolumes
from uam_lab.experiments.tuning.search import DONE, evaluated_start
from uam_lab.experiments.tuning.space import Space
from uam_lab.report.figures import style


def best_of(space: Space, study: optuna.Study) -> FrozenTrial:
    """Return the best evaluation: of least cost, with the margin that the space asks for."""
    if space.delay_margin is None:
        return study.best_trial
    return chosen(study.get_trials(deepcopy=False, states=DONE), space.delay_margin)


def in_words(trial: FrozenTrial | None) -> str:
    """Return cost and, if it is an objective, delay margin of an evaluation; None: without one."""
    if trial is None:
        return "not evaluated"
    cost, *margin = trial.values
    return f"cost {cost:.4g}" + "".join(f", delay margin {1e3 * one:.1f} ms" for one in margin)


def write_best(file: Path, space: Space, study: optuna.Study, command: str) -> None:
    """Write the best profile, with its origin as comment at the beginning."""
    best = best_of(space, study)
    profile = space.profile(best.params, file.stem)
    evaluations = len(study.get_trials(deepcopy=False, states=DONE))
    head = [
        f"Found by: {command}",
        f"Study {study.study_name}, {evaluations} evaluations, best of them {best.number}: "
        f"{in_words(best)} (start: {in_words(evaluated_start(space, study))}), "
        f"from profile {space.start.name}.",
        f"Vehicle: {space.start.vehicle.name}.",
        "Flights of an evaluation: "
        + "; ".join(
            f"{flight['payload_mass']:g} kg seed {flight['seed']}"
            + "".join(f" {k}={v}" for k, v in flight.get("vehicle", {}).items())
            for flight in space.flights
        ),
    ]
    write_text(file, "".join(f"# {line}\n" for line in head) + as_text(profile.sections))


def write_evaluations(file: Path, space: Space, study: optuna.Study) -> None:
    """Write one row per evaluation: number, objectives, values of the knobs."""
    names = [knob.name for knob in space.knobs]
    write_rows(
        file,
        ["evaluation", *("cost", "delay_margin_s")[: len(study.directions)], *names],
        (
            [
                trial.number,
                *(f"{value:.6g}" for value in trial.values),
                *(f"{trial.params.get(name, np.nan):.6g}" for name in names),
            ]
            for trial in study.get_trials(deepcopy=False, states=DONE)
        ),
    )


def plot(file: Path, space: Space, study: optuna.Study) -> None:
    """Draw the objectives of every evaluation, the progress, and the values of each knob."""
    trials = study.get_trials(deepcopy=False, states=DONE)
    costs, best = np.array([trial.values[0] for trial in trials]), best_of(space, study)
    start = evaluated_start(space, study)
    columns = 4
    rows = -(-len(space.knobs) // columns)
    with style.styled():
        figure = Figure(figsize=(style.WIDTH, 2.8 + 1.25 * rows), layout="constrained")
        top, bottom = figure.subfigures(2, 1, height_ratios=(2.8, 1.25 * rows))
        if space.delay_margin is None:
            _draw_costs(top.subplots(), costs)
        else:
            curve, plane = top.subplots(1, 2)
            curve.step(np.arange(len(trials)), hypervolumes(trials), where="post", color=style.INK)
            curve.set(xlabel="evaluation", ylabel="area under the front [ms]")
            _draw_front(plane, trials, best, start, space.delay_margin)
        figure.suptitle(
            f"Search {study.study_name}, {space.start.vehicle.name}: {len(costs)} evaluations; "
            f"best: {in_words(best)}; start: {in_words(start)}",
            fontsize=8,
        )
        for knob, small in zip(space.knobs, bottom.subplots(rows, columns).flat, strict=False):
            values = [trial.params[knob.name] for trial in trials]
            small.scatter(values, costs, s=4, color=style.FLIGHTS[0], alpha=0.4)
            small.axvline(best.params[knob.name], color=style.INK, linewidth=0.8)
            small.set(xscale="log", yscale="log", xlim=(knob.low, knob.high))
            small.set_title(knob.name.replace("_controller", ""), fontsize=6.5, loc="left")
            small.tick_params(labelsize=5.5, which="both")
        style.save(figure, file)


def _draw_costs(axis: Axes, costs: np.ndarray) -> None:
    numbers = np.arange(len(costs))
    axis.plot(numbers, costs, ".", color=style.FLIGHTS[0], alpha=0.5, label="evaluation")
    best_so_far = np.minimum.accumulate(costs)
    axis.step(numbers, best_so_far, where="post", color=style.INK, label="best so far")
    axis.set(yscale="log", xlabel="evaluation", ylabel="cost")
    axis.legend(loc="upper right")


def _draw_front(
    axis: Axes,
    trials: Sequence[FrozenTrial],
    best: FrozenTrial,
    start: FrozenTrial | None,
    at_least: float,
) -> None:
    """Draw cost and margin of every evaluation; the front, the best and the start stand out."""

    def points(shown: Sequence[FrozenTrial]) -> tuple[list[float], list[float]]:
        return [one.values[0] for one in shown], [1e3 * one.values[1] for one in shown]

    axis.plot(*points(trials), ".", color=style.FLIGHTS[0], alpha=0.4, label="evaluation")
    axis.step(*points(front(trials)), where="post", color=style.INK, label="front")
    if start is not None:
        axis.plot(*points([start]), "s", color=style.FLIGHTS[1], label="start")
    axis.plot(*points([best]), "D", color=style.FLIGHTS[2], label="best")
    axis.axhline(1e3 * at_least, color=style.MUTED, linewidth=0.8, linestyle="--")
    axis.set(xscale="log", xlabel="cost", ylabel="delay margin [ms]")
    axis.legend(loc="lower right")
