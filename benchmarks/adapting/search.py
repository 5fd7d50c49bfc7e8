"""Search of the adaptation's own numbers, with the same budget for every law."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import optuna

from adapting import design
from adapting.description import Row, Study
from adapting.flights import StudyResult, flights, measure
from uam_control.settings.parameter_file import ProfileError

DIGITS = 3  # significant digits of a value
PATIENCE = 80  # last evaluations, which tell whether a search has converged
STEP = 0.1  # initial step around the study's own numbers, as a share of the logarithmic range


@dataclass(frozen=True)
class Search:
    """The search of one law. costs: of every evaluation, in order; best: its numbers."""

    law: str
    costs: tuple[float, ...]
    best: dict[str, float]


def cost(results: list[StudyResult], aim: list[float], failed: float) -> float:
    """Return the mean cost of flights: the mean of error / aim; `failed` if cut short."""
    found = []
    for result in results:
        ratio = float(np.mean(np.array(result.errors) / np.array(aim)))
        usable = result.flown and np.isfinite(ratio)
        found.append(min(ratio, failed) if usable else failed)
    return float(np.mean(found))


def search(
    study: Study,
    law: str,
    strength: dict[str, dict[str, float]],
    evaluations: int,
    folder: Path,
    progress: Callable[[str], None],
) -> Search:
    """Search with CMA-ES over the study's flights for tuning, from its start, evaluated first.

    Repeatable: one process, fixed seed.
    """
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    warnings.filterwarnings("ignore", module="optuna")
    entry = study.document["tuning"]
    conditions = [study.condition(label) for label in entry["conditions"]]
    ranges, start = study.document["ranges"][law], entry["start"][law]
    costs: list[float] = []

    def evaluate(trial: optuna.Trial) -> float:
        values = {
            name: float(f"{trial.suggest_float(name, low, high, log=True):.{DIGITS}g}")
            for name, (low, high) in ranges.items()
        }
        costs.append(measured(values))
        progress(f"{law}: evaluation {len(costs)} of {evaluations}, best {min(costs):.4g}")
        return costs[-1]

    def measured(values: dict[str, float]) -> float:
        try:
            made = design.profile(study.with_adaptation(law, values), Row(law, law), strength)
        except ProfileError:  # a parameter that follows from the values is out of its range
            return float(entry["failed"])
        flown = flights(study, {law: made}, conditions, [entry["seed"]], folder)
        return cost([measure(one) for one in flown], entry["aim"], entry["failed"])

    sampler = optuna.samplers.CmaEsSampler(
        x0=dict(start), sigma0=STEP, seed=1, warn_independent_sampling=False
    )
    optimiser = optuna.create_study(sampler=sampler)
    optimiser.enqueue_trial(dict(start))
    optimiser.optimize(evaluate, n_trials=evaluations)
    best = {k: float(f"{v:.{DIGITS}g}") for k, v in optimiser.best_params.items()}
    return Search(law, tuple(costs), best)
