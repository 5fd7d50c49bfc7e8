"""The search itself: an Optuna study that any number of processes, and machines, work on.

The study lives in the optimiser's own storage: a journal file in the result folder, or whatever
`--storage` names (a database that several machines reach). Every evaluation is in it, so a search
that was stopped goes on where it was.
"""

from __future__ import annotations

import multiprocessing
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import optuna
from optuna.storages import JournalStorage, RDBStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import TrialState

from uam_lab.campaign.pool import prepare_worker
from uam_lab.campaign.trial import fly
from uam_lab.tuning.space import Space, TuningError

POLL = 1.0  # [s]
STEP = 0.1  # of the logarithmic range: how far CMA-ES looks around the start at first
HOPELESS = 1.5  # times the best cost so far: what one flight alone may exceed it before we give up
DONE = (TrialState.COMPLETE, TrialState.PRUNED)


@dataclass(frozen=True)
class Task:
    """What each worker is told."""

    space: Space
    study: str
    storage: str
    evaluations: int
    seed: int
    step: float = STEP


def open_storage(where: str) -> JournalStorage | RDBStorage:
    """A journal file, or a database URL as sqlite:///file.db or mysql://...; TuningError."""
    try:
        if "://" in where:
            return RDBStorage(where, heartbeat_interval=60)
        return JournalStorage(JournalFileBackend(where))
    except Exception as error:  # whatever the database's driver raises
        raise TuningError(f"storage {where}: {str(error).splitlines()[0]}") from None


def open_study(task: Task) -> optuna.Study:
    """The study, made with the start values enqueued when it is new."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    warnings.filterwarnings("ignore", category=FutureWarning, module="optuna")
    space = task.space
    start = {knob.name: knob.value(space.start) for knob in space.knobs}
    sampler = optuna.samplers.CmaEsSampler(
        x0=start, sigma0=task.step, seed=task.seed, warn_independent_sampling=False
    )
    study = optuna.create_study(
        storage=open_storage(task.storage),
        study_name=task.study,
        sampler=sampler,
        load_if_exists=True,
    )
    if not study.trials:
        study.enqueue_trial(start, skip_if_exists=True)
    return study


def evaluate(space: Space, trial: optuna.Trial, best: float | None) -> float:
    """Fly one candidate; the mean cost of its flights. Pruned once it cannot be good any more."""
    values = {
        knob.name: trial.suggest_float(knob.name, knob.low, knob.high, log=True)
        for knob in space.knobs
    }
    costs: list[float] = []
    trials = space.trials(space.profile(values))
    for number, flight in enumerate(trials):
        result = fly(flight)[0]
        costs.append(space.cost.of(result))
        trial.set_user_attr(f"flight {number}", {"cost": costs[-1], "rms": result.rms.tolist()})
        hopeless = best is not None and sum(costs) > HOPELESS * best * len(trials)
        if hopeless and number + 1 < len(trials):
            # Told to the sampler with what is known: every further flight as bad as those so far.
            return sum(costs) / len(costs) * (1.0 + 0.1 * (len(trials) - len(costs)))
    return sum(costs) / len(costs)


def work(task: Task, number: int) -> None:
    """Evaluate until the study has as many evaluations as asked for; a worker's whole life."""
    prepare_worker()
    study = open_study(Task(**{**vars(task), "seed": task.seed + number}))
    study.optimize(
        lambda trial: evaluate(task.space, trial, _best(study)),
        callbacks=[optuna.study.MaxTrialsCallback(task.evaluations, states=DONE)],
    )


def _best(study: optuna.Study) -> float | None:
    try:
        return study.best_value
    except ValueError:
        return None


def search(task: Task, jobs: int, progress: Callable[[int, float | None], None]) -> optuna.Study:
    """Work on the study with `jobs` processes until it has task.evaluations, or Ctrl-C.

    progress: called about once a second with the evaluations done and the best cost. Raises
    TuningError when a worker fails, KeyboardInterrupt when the user stops it; the study keeps
    what was found.
    """
    study = open_study(task)
    context = multiprocessing.get_context("spawn")
    workers = [context.Process(target=work, args=(task, i), daemon=True) for i in range(jobs)]
    if _done(study) < task.evaluations:
        for worker in workers:
            worker.start()
    try:
        while any(worker.is_alive() for worker in workers):
            progress(_done(study), _best(study))
            time.sleep(POLL)
            failed = [worker for worker in workers if worker.exitcode]
            if failed:
                raise TuningError("a worker failed; its last lines are above")
    finally:
        for worker in workers:
            if worker.is_alive():
                worker.terminate()
                worker.join()
    progress(_done(study), _best(study))
    return study


def _done(study: optuna.Study) -> int:
    return len(study.get_trials(deepcopy=False, states=DONE))
