"""A message that several readers of one process receive is read once.

Nodes in one process receive the same object (`uam_msgs_py.node.local_delivery`). Each reads it by
the same function; all but the first get the result of the first.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

T = TypeVar("T")


def read_once(read: Callable[..., T]) -> Callable[..., T]:
    """Return `read(data, *further)` that keeps the result of its newest call.

    A call with the same object `data` and equal further arguments returns it again; the caller must
    not change it. An exception is not kept.
    """
    newest: tuple[Any, tuple, T] | None = None

    @wraps(read)
    def reading(data: Any, *further: Any) -> T:
        nonlocal newest
        if newest is not None and newest[0] is data and newest[1] == further:
            return newest[2]
        result = read(data, *further)
        newest = data, further, result
        return result

    return reading
