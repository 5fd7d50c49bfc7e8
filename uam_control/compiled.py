"""Compilation of the small fixed-size maths in the control loop.

NumPy spends about a microsecond per call on arrays of three; a control law makes hundreds of such
calls per tick. Compiled once (and cached on disk), the same code runs ten to a hundred times
faster, which matters for campaigns of thousands of flights and on a companion computer.

The code stays plain Python: without numba, or with NUMBA_DISABLE_JIT=1 in the environment (for
debuggers and coverage), every function runs as written and gives the same numbers up to rounding.
"""

from collections.abc import Callable
from typing import TypeVar

try:
    import numba
except ImportError:
    numba = None

F = TypeVar("F", bound=Callable)


def jit(function: F) -> F:
    """Compile `function` on its first call, if numba is there; otherwise return it unchanged."""
    if numba is None:
        return function
    return numba.njit(cache=True)(function)
