"""Work for tests of the workers: milliseconds, importable in another process."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path


def square(number: int) -> int:
    """Return the square."""
    return number * number


def lose_two_workers(task: tuple[str, int]) -> tuple[int, int]:
    """Return the square and this process; the first to begin items 3 and 9 kill their worker."""
    folder, number = task
    if number in (3, 9):
        try:
            (Path(folder) / str(number)).touch(exist_ok=False)
            os.kill(os.getpid(), signal.SIGKILL)
        except FileExistsError:
            pass
    return number * number, os.getpid()


def fail(number: int) -> None:
    """Raise ValueError."""
    raise ValueError(f"item {number} is not possible")


def prepare() -> None:
    """Leave a mark of this process in the folder of the environment variable PREPARED, if any."""
    folder = os.environ.get("PREPARED")
    if folder:
        (Path(folder) / f"{os.getpid()}-{time.time_ns()}").touch()


def main() -> None:
    """Work on local workers until a signal comes; print their processes first."""
    from uam_lab.experiments.workers.place import Workplace
    from uam_lab.experiments.workers.workers import workers

    with workers(Workplace(2)) as crew:
        for _, result in crew.completed(slow, iter(range(10**6))):
            print(result, flush=True)


def slow(number: int) -> int:
    """Return this process, a little later."""
    time.sleep(0.05)
    return os.getpid()


if __name__ == "__main__":
    main()
