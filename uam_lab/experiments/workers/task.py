"""What runs in a worker's process: checks and preparation once, then the work."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any

from distributed import get_worker

from uam_lab.experiments.workers.identity import difference, identity
from uam_lab.experiments.workers.place import WorkersError

_prepared: set[str] = set()
_one_at_a_time = threading.Lock()


def run(
    work: Callable[[Any], Any],
    item: Any,
    expected: Mapping[str, str],
    prepare: Callable[[], None] | None,
) -> Any:
    """Return work(item). expected: `identity` of the process that handed it out.

    prepare: is called once in this process, before its first item. Raises WorkersError if this
    worker has other versions.
    """
    other = difference(expected, identity())
    if other:
        raise WorkersError(
            f"worker {get_worker().address} has {other}: install the same on every worker"
        )
    with _one_at_a_time:
        if prepare is not None and prepare.__qualname__ not in _prepared:
            prepare()
            _prepared.add(prepare.__qualname__)
    return work(item)
