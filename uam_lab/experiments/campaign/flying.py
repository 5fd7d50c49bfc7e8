"""Flies many trials: on workers, or one after another in this process where they need nodes.

A trial is a `Trial`, or contains one as `trial`, or has its `engine` and `keep`.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

from uam_lab.experiments.campaign.carried import arrived, carried
from uam_lab.experiments.campaign.trial import Trial, measure
from uam_lab.experiments.workers.place import Workplace
from uam_lab.experiments.workers.workers import workers
from uam_lab.flights.direct.warm_up import prepare_direct
from uam_lab.records.results.atomic import replacing
from uam_lab.records.results.row_table import RowTable

Progress = Callable[[int, Any], None]


def fly_all(
    trials: Sequence[Any],
    place: Workplace,
    progress: Progress = lambda done, result: None,
) -> list[Any]:
    """Fly every trial; return the results in the order of the trials.

    progress: called with the number of finished flights and the newest result.
    """
    results: list[Any] = [None] * len(trials)
    for done, (number, result) in enumerate(_flown(trials, place, measure), 1):
        results[number] = result
        progress(done, result)
    return results


def fly_into(
    table: RowTable,
    keyed: Iterable[tuple[Any, Any]],
    place: Workplace,
    to_row: Callable[[Any, Any], dict[str, Any]],
    work: Callable[[Any], Any] = measure,
    progress: Progress = lambda done, result: None,
) -> None:
    """Fly trials; add each result to the table when it comes.

    keyed: key and trial, drawn when a worker needs one. to_row: from key and result.
    """
    keys: list[Any] = []

    def trials() -> Iterator[Any]:
        for key, trial in keyed:
            keys.append(key)
            yield trial

    with table:
        for done, (number, result) in enumerate(_flown(trials(), place, work), 1):
            table.add(to_row(keys[number], result))
            progress(done, result)


def fly_missing(
    table: RowTable,
    trials: Mapping[Any, Any],
    place: Workplace,
    to_row: Callable[[Any, Any], dict[str, Any]],
    work: Callable[[Any], Any] = measure,
    progress: Progress = lambda done, result: None,
) -> dict[Any, dict[str, Any]]:
    """Fly the trials that the table has no row of, or whose file to keep is missing.

    trials: by key. Returns all rows, by key, in the order of the trials.
    """

    def there(key: Any) -> bool:
        keep = _trial(trials[key]).keep
        return key in table.keys and (keep is None or keep.exists())

    missing = [(key, trial) for key, trial in trials.items() if not there(key)]
    known = len(trials) - len(missing)
    fly_into(table, missing, place, to_row, work, lambda n, result: progress(known + n, result))
    key = table.key
    rows = {row[key]: row for row in table.compact().to_pylist()}
    return {key: rows[key] for key in trials}


def _flown(
    trials: Iterable[Any], place: Workplace, work: Callable[[Any], Any]
) -> Iterator[tuple[int, Any]]:
    """Yield number and result of each trial."""
    for engine, group in groupby(enumerate(trials), lambda one: _trial(one[1]).engine):
        if engine != "direct":  # every node is a process already
            yield from ((number, work(trial)) for number, trial in group)
        else:
            yield from _flown_by_workers(group, place, work)


def _flown_by_workers(
    numbered: Iterable[tuple[int, Any]], place: Workplace, work: Callable[[Any], Any]
) -> Iterator[tuple[int, Any]]:
    numbers: list[int] = []
    keep: dict[int, Path] = {}  # the files to keep, of the flights that are handed out

    def errands() -> Iterator[_Errand]:
        for number, trial in numbered:
            numbers.append(number)
            own = _trial(trial)
            if own.keep is not None:
                keep[number], trial = own.keep, _with(trial, keep=Path())
            if place.scheduler:
                trial = _with(trial, carried=carried(own.scenario, own.profile))
            yield _Errand(work, trial)

    if not place.scheduler:
        prepare_direct()  # here once, not in every worker
    with workers(place, prepare_direct, partial(print, flush=True)) as crew:
        for k, (result, content) in crew.completed(_run, errands()):
            number = numbers[k]
            if number in keep:
                with replacing(keep.pop(number)) as temporary:
                    temporary.write_bytes(content)
            yield number, result


@dataclass(frozen=True)
class _Errand:
    """What a worker gets. A trial with any file to keep returns the file's content."""

    work: Callable[[Any], Any]
    trial: Any


def _run(errand: _Errand) -> tuple[Any, bytes | None]:
    """Fly in a worker; return the result and the content of the file to keep, if any."""
    trial = errand.trial
    own = _trial(trial)
    if own.carried is not None:
        trial = _with(trial, profile=arrived(own.carried, own.profile))
    if _trial(trial).keep is None:
        return errand.work(trial), None
    with tempfile.TemporaryDirectory(prefix="uam-keep-") as folder:
        file = Path(folder) / "kept.parquet"
        result = errand.work(_with(trial, keep=file))
        return result, file.read_bytes()


def _trial(trial: Any) -> Trial:
    return getattr(trial, "trial", trial)


def _with(trial: Any, **changes: Any) -> Any:
    """Return the trial with changed entries."""
    inner = getattr(trial, "trial", None)
    if inner is None:
        return replace(trial, **changes)
    return replace(trial, trial=replace(inner, **changes))
