"""Changes of this process's environment variables for a moment, in one thread at a time.

ROS and the numerical libraries read some variables when they start. Several flights of one program
run in threads, so each change and each copy is made under one lock.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator, Mapping

_lock = threading.RLock()


def copied() -> dict[str, str]:
    """Return a copy of the variables, without the changes of `borrowed` in other threads."""
    with _lock:
        return dict(os.environ)


@contextlib.contextmanager
def borrowed(environment: Mapping[str, str]) -> Iterator[None]:
    """Set these variables within the `with` block."""
    with _lock:
        before = {name: os.environ.get(name) for name in environment}
        os.environ.update(environment)
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    os.environ.pop(name, None)
                else:
                    os.environ[name] = value
