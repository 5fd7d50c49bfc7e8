"""An experiment: flights into the table of a result folder, each once, also after an interruption.

They are flown by workers, or one after another in this process where they need nodes.
"""

import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
from pyarrow.csv import write_csv

from uam_control.settings.atomic import replacing
from uam_lab.experiments.trials.carried import arrived, carried
from uam_lab.experiments.trials.counting import Counting
from uam_lab.experiments.trials.rows import Rows, RowTable
from uam_lab.experiments.trials.trial import Trial, measure
from uam_lab.experiments.workers.place import Workplace
from uam_lab.experiments.workers.workers import workers
from uam_lab.flights.direct.warm_up import prepare
from uam_lab.records.results.terminal import say

TABLE = "flights.parquet"  # in the result folder
Work = Callable[[Any], Any]


@dataclass(frozen=True)
class Experiment:
    """Flights of one kind, and the table of their results."""

    name: str  # for the progress
    table: Path  # its file
    rows: Rows
    inputs: Mapping[str, str]  # see `carried.inputs`
    place: Workplace
    work: Work = measure  # flies a trial and returns its result

    def write_csv(self) -> None:
        """Write the table beside itself as CSV, for a spreadsheet."""
        with replacing(self.table.with_suffix(".csv")) as temporary:
            write_csv(pq.read_table(self.table), temporary)

    def fly_all(self, trials: Sequence[Any], describe: Callable[[Any], str]) -> list[Any]:
        """Fly these trials, by their numbers, as `fly`; return the results in their order."""
        return list(self.fly(range(len(trials)), trials.__getitem__, describe).values())

    def fly(
        self,
        keys: Collection[Any],
        trial: Callable[[Any], Trial],
        describe: Callable[[Any], str] = lambda result: "",
    ) -> dict[Any, Any]:
        """Fly the trials that the table has no row of, or whose file to keep is missing.

        trial: of a key, made when a worker needs it; describe: text about the newest result.
        Returns key → result of all `keys`, in their order. Raises RowTableError if the table has
        flights with other inputs, KeyboardInterrupt with what continues.
        """
        table = RowTable(self.table, self.rows.schema, self.inputs)

        def there(key: Any) -> bool:
            return key in table.keys and ((keep := trial(key).keep) is None or keep.exists())

        missing = [key for key in keys if not there(key)]
        before = len(keys) - len(missing)
        if before:
            say(f"{self.name}: continuing after {before} earlier flights")
        try:
            with Counting(self.name, len(keys)) as counting, table:
                flown = flown_by(self.place, map(trial, missing), self.work)
                for done, (number, result) in enumerate(flown, before + 1):
                    table.add(self.rows.to_row(missing[number], result))
                    counting.show(done, describe(result))
        except KeyboardInterrupt:
            again = f"the same command with --out {self.table.parent} continues"
            raise KeyboardInterrupt(again) from None
        rows = {row[table.key]: row for row in table.compact().to_pylist()}
        return {key: self.rows.from_row(rows[key]) for key in keys}


def flown_by(
    place: Workplace, trials: Iterable[Any], work: Work = measure
) -> Iterator[tuple[int, Any]]:
    """Yield number and result of each trial, in the order in which they come."""
    for engine, group in groupby(enumerate(trials), lambda one: one[1].engine):
        if engine != "direct":  # every node is a process already
            yield from ((number, work(trial)) for number, trial in group)
        else:
            yield from _flown_by_workers(place, group, work)


def _flown_by_workers(
    place: Workplace, numbered: Iterable[tuple[int, Trial]], work: Work
) -> Iterator[tuple[int, Any]]:
    numbers: list[int] = []
    keep: dict[int, Path] = {}  # the files to keep, of the flights that are handed out

    def sent() -> Iterator[Trial]:
        """Yield the trials for workers: those with any file to keep return the file's content."""
        for number, trial in numbered:
            numbers.append(number)
            if trial.keep is not None:
                keep[number], trial = trial.keep, replace(trial, keep=Path())
            if place.scheduler:
                trial = replace(trial, carried=carried(trial.scenario, trial.profile))
            yield trial

    if not place.scheduler:
        prepare()  # here once, not in every worker
    with workers(place, prepare, partial(print, flush=True)) as crew:
        for k, (result, content) in crew.completed(partial(_run, work), sent()):
            number = numbers[k]
            if number in keep:
                with replacing(keep.pop(number)) as temporary:
                    temporary.write_bytes(content)
            yield number, result


def _run(work: Work, trial: Trial) -> tuple[Any, bytes | None]:
    """Fly in a worker; return the result and the content of the file to keep, if any."""
    if trial.carried is not None:
        trial = replace(trial, profile=arrived(trial.carried, trial.profile))
    if trial.keep is None:
        return work(trial), None
    with tempfile.TemporaryDirectory(prefix="uam-keep-") as folder:
        file = Path(folder) / "kept.parquet"
        result = work(replace(trial, keep=file))
        return result, file.read_bytes()
