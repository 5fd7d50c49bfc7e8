"""One rehearsal of a matrix of cable faults, and its result."""

import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

from uam_lab.experiments.faults import trial as fault_trial
from uam_lab.experiments.faults.matrix import Cell
from uam_lab.experiments.faults.trial import FaultResult, FaultTrial
from uam_lab.experiments.trials.outcome import LOST, REFUSED
from uam_lab.flights.conclude import conclude
from uam_lab.flights.direct.warm_up import prepare
from uam_lab.flights.observer import Observer
from uam_lab.flights.processes.interrupts import Interrupts
from uam_lab.flights.rehearsal import engine
from uam_lab.flights.vehicle.lab_file import load_lab, settings_of
from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.result_folder import ResultFolder
from uam_sim_bridge.faults.schedule import FROM_START


def measure(trial: FaultTrial) -> FaultResult:
    """Rehearse a trial; return its result. Raises ConfigurationError, ScenarioError, LabError.

    Ctrl-C ends the flight in order and is then raised as KeyboardInterrupt.
    """
    cell = trial.cell
    lab = replace(load_lab(trial.lab), scenario=trial.scenario)
    settings = replace(settings_of(lab), seed=trial.seed, faults=cell.schedule)
    prepare()
    with tempfile.TemporaryDirectory(prefix="uam-rehearsal-") as place, Interrupts() as stop:
        folder = ResultFolder(Path(place))
        outcome = engine.fly(lab, settings, folder, Observer(), stop, with_checklist(cell))
        figures = conclude(settings, folder, outcome)
        if stop.raised:
            raise KeyboardInterrupt
        result = judged(cell, outcome, figures)
        if result.kept is False:
            name = f"{cell.fault} {cell.moment}".replace(" ", "_").replace("/", "_")
            shutil.copytree(place, trial.broken / name, symlinks=True, dirs_exist_ok=True)
    return result


def with_checklist(cell: Cell) -> bool:
    """Return whether a person does the lists: for the wiring, and without a fault."""
    faults = cell.schedule.faults
    return not faults or any(one.at == FROM_START for one in faults)


def judged(cell: Cell, outcome: Outcome, figures: dict | None) -> FaultResult:
    """Return the result of a rehearsal; figures: its metrics, None without a recording."""
    if not outcome.failure.startswith(engine.REFUSED):
        return fault_trial.judged(cell, outcome, figures)
    promise = cell.promise
    flown = outcome.series is not None and bool(outcome.series.flown.any())
    ending = LOST if flown else REFUSED
    kept = None if promise is None else promise.kept(ending, None, outcome.failure)
    return FaultResult(cell.fault, cell.moment, ending, outcome.failure, 0.0, kept=kept)
