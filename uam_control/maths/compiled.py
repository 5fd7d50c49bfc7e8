"""Compilation of the small fixed-size maths in the control loop.

NumPy spends about a microsecond per call on arrays of three; a control law makes hundreds of such
calls per tick. Compiled once (and kept on disk, see `compile_cache`), the same code runs ten to a
hundred times faster, which matters for campaigns of thousands of flights and on a companion
computer.

The code stays plain Python: without numba, or with NUMBA_DISABLE_JIT=1 in the environment (for
debuggers and coverage), every function runs as written and gives the same numbers up to rounding.
"""

from collections.abc import Callable
from typing import TypeVar

try:
    import numba

    from uam_control.maths.compile_cache import CompileCache
except ImportError:
    numba = None

F = TypeVar("F", bound=Callable)


def jit(function: F) -> F:
    """Compile `function` on its first call, if numba is there; otherwise return it unchanged."""
    if numba is None:
        return function
    compiled = numba.njit(function)
    if not numba.config.DISABLE_JIT:
        compiled._cache = CompileCache(function)
    return compiled
