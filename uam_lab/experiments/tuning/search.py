"""The search: an Optuna study, evaluated by several workers of this machine or of a cluster.

One objective, the cost of the flights, is searched with CMA-ES; cost and delay margin together with
the tree-structured Parzen estimator, which has several objectives.

The study is stored in a journal file in the result folder, or in the database of `--storage`, which
several machines can use. The storage contains every evaluation, so a stopped search can continue.
"""

import itertools
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import optuna
from optuna.storages import JournalStorage, RDBStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import FrozenTrial, TrialState

from uam_lab.experiments.trials.carried import inputs
from uam_lab.experiments.trials.trial import measure
from uam_lab.experiments.tuning.front import SMALL, delay_margin, hypervolumes, improvement
from uam_lab.experiments.tuning.space import Space, TuningError
from uam_lab.experiments.workers.identity import difference
from uam_lab.experiments.workers.place import Workplace
from uam_lab.experiments.workers.workers import workers
from uam_lab.flights.direct.warm_up import prepare

STEP = 0.1  # initial step of CMA-ES around the start, as a fraction of the logarithmic range
HOPELESS = 1.5  # a candidate is pruned when its cost exceeds this factor times the best cost
DONE = (TrialState.COMPLETE, TrialState.PRUNED)
PROBLEM = "problem"  # attribute of the study: `problem` of its space


@dataclass(frozen=True)
class Task:
    """Settings of a search, the same for each worker."""

    space: Space
    study: str
    storage: str
    evaluations: int
    seed: int
    step: float = STEP
    patience: int = 0  # evaluations without improvement that end the search; 0: none do


def open_storage(where: str) -> JournalStorage | RDBStorage:
    """Open a journal file, or a database by URL, as sqlite:///file.db. Raises TuningError."""
    try:
        if "://" in where:
            return RDBStorage(where, heartbeat_interval=60)
        found = JournalStorage(JournalFileBackend(where))
    except Exception as error:  # drivers of databases raise different types
        raise TuningError(f"storage {where}: {str(error).splitlines()[0]}") from None
    if Path(where).read_bytes()[-1:] not in (b"", b"\n"):  # Optuna would append to it
        raise TuningError(f"storage {where}: its last line was not written to its end: remove it")
    return found


def open_study(task: Task) -> optuna.Study:
    """Open the study, a new one if there is none. Raises TuningError."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    for kind in (FutureWarning, optuna.exceptions.ExperimentalWarning):
        warnings.filterwarnings("ignore", category=kind, module="optuna")
    space = task.space
    if space.delay_margin is None:
        directions = ["minimize"]
        sampler = optuna.samplers.CmaEsSampler(
            x0=space.start_values,
            sigma0=task.step,
            seed=task.seed,
            warn_independent_sampling=False,
        )
    else:
        directions = ["minimize", "maximize"]
        sampler = optuna.samplers.TPESampler(seed=task.seed, multivariate=True, constant_liar=True)
    return optuna.create_study(
        storage=open_storage(task.storage),
        study_name=task.study,
        sampler=sampler,
        directions=directions,
        load_if_exists=True,
    )


def refuse_other_study(task: Task) -> None:
    """Raise TuningError if the storage, which is that of one result folder, has another study."""
    for name in optuna.get_all_study_names(open_storage(task.storage)):
        if name != task.study:
            raise TuningError(f"{task.storage} has the study {name}: give another --out")


def problem(space: Space) -> dict[str, str]:
    """Return name → digest of all that the costs depend on; equal on every machine."""
    start, found = space.start, {}
    further = {
        "space": (space.knobs, space.flights, space.cost, space.delay_margin),
        "profile": (start.sets, start.bridge()),
    }
    for scenario in sorted({trial.scenario for trial in space.trials(start)}):
        found |= inputs(start.vehicle, scenario, further)
        found[f"scenario {scenario}"] = found.pop("scenario")
    return found


def evaluated_start(space: Space, study: optuna.Study) -> FrozenTrial | None:
    """Return the evaluation of the start values, None if it was not completed."""
    done = study.get_trials(deepcopy=False, states=DONE)
    return next((trial for trial in done if trial.params == space.start_values), None)


def _begin(study: optuna.Study, space: Space) -> None:
    """Enqueue the start values unless they are evaluated. Raises TuningError.

    An evaluation that was killed stays RUNNING, so the start may be evaluated twice.
    """
    own = problem(space)
    before = study.user_attrs.get(PROBLEM, own)
    if before != own:
        changed = difference(before, own) if isinstance(before, dict) else "an earlier version"
        raise TuningError(
            f"study {study.study_name} has evaluations with other inputs ({changed}): undo the "
            "change, or give another --out, with --storage another --study"
        )
    study.set_user_attr(PROBLEM, own)
    waiting = study.get_trials(deepcopy=False, states=(TrialState.WAITING,))
    if not waiting and evaluated_start(space, study) is None:
        study.enqueue_trial(space.start_values)


def evaluate(space: Space, trial: optuna.Trial, best: float | None) -> float | tuple[float, float]:
    """Fly one candidate; return the mean cost of its flights, with its delay margin if searched.

    best: least cost so far; a bad candidate is pruned early. None: all flights are flown.
    """
    values = {
        knob.name: trial.suggest_float(knob.name, knob.low, knob.high, log=True)
        for knob in space.knobs
    }
    costs: list[float] = []
    profile = space.profile(values)
    trials = space.trials(profile)
    for number, flight in enumerate(trials):
        result = measure(flight)
        costs.append(space.cost.of(result))
        trial.set_user_attr(f"flight {number}", {"cost": costs[-1], "rms": result.rms.tolist()})
        hopeless = best is not None and sum(costs) > HOPELESS * best * len(trials)
        if hopeless and number + 1 < len(trials):
            # estimate for the sampler: mean so far, plus 10 % per flight not flown
            return sum(costs) / len(costs) * (1.0 + 0.1 * (len(trials) - len(costs)))
    cost = sum(costs) / len(costs)
    return cost if space.delay_margin is None else (cost, delay_margin(profile))


def work(task: Task) -> None:
    """Evaluate candidates until the study is `finished`; runs in each worker."""
    study = open_study(task)

    def end(study: optuna.Study, _: optuna.trial.FrozenTrial) -> None:
        if finished(study, task):
            study.stop()

    study.optimize(
        lambda trial: evaluate(
            task.space, trial, _progress(study) if task.space.delay_margin is None else None
        ),
        callbacks=[end],
    )


def curve(study: optuna.Study) -> list[float]:
    """Return the least cost after each evaluation; with two objectives the area of the front."""
    trials = study.get_trials(deepcopy=False, states=DONE)
    if len(study.directions) > 1:
        return hypervolumes(trials)
    return list(itertools.accumulate((trial.values[0] for trial in trials), min))


def finished(study: optuna.Study, task: Task) -> bool:
    """Return whether the study has its evaluations, or has converged (`Task.patience`)."""
    if _done(study) >= task.evaluations:
        return True
    return task.patience > 0 and improvement(curve(study), task.patience) < SMALL


def _progress(study: optuna.Study) -> float | None:
    return next(reversed(curve(study)), None)


def search(
    task: Task, place: Workplace, progress: Callable[[int, float | None], None]
) -> optuna.Study:
    """Extend the study until it is `finished`, each worker with its own seed; return it.

    progress: called about once per second with the number of evaluations and the best cost, or with
    the volume of the front. A worker that is lost or comes later continues the same study. Raises
    WorkersError, KeyboardInterrupt on Ctrl-C, TuningError for a study of another `problem`, and
    what an evaluation raises; the study keeps its evaluations.
    """
    study = open_study(task)
    _begin(study, task.space)
    seeds = itertools.count(task.seed)
    tasks = itertools.takewhile(
        lambda _: not finished(study, task), (replace(task, seed=one) for one in seeds)
    )

    def show() -> None:
        progress(_done(study), _progress(study))

    if not finished(study, task):
        prepare()
        with workers(place, prepare, partial(print, flush=True)) as crew:
            for _ in crew.completed(work, tasks, per_worker=1, idle=show):
                show()
    show()
    return study


def _done(study: optuna.Study) -> int:
    return len(study.get_trials(deepcopy=False, states=DONE))
