"""Compilation of the small fixed-size functions of the control loop.

NumPy needs about a microsecond per call for arrays of three; a control law makes hundreds of such
calls per tick. Compiled code (kept on disk, see `compile_cache`) is ten to a hundred times faster.
Campaigns of thousands of flights and a companion computer need this.

The code stays plain Python. Without numba, or with NUMBA_DISABLE_JIT=1 in the environment (for
debuggers and coverage), every function runs in Python and gives the same numbers up to rounding.
"""

from collections.abc import Callable
from typing import TypeVar

try:
    import numba

    from uam_control.maths.compile_cache import CompileCache
except ImportError:
    numba = None

F = TypeVar("F", bound=Callable)


def active() -> bool:
    """Return whether functions under `jit` are compiled."""
    return numba is not None and not numba.config.DISABLE_JIT


def jit(function: F) -> F:
    """Return `function`, compiled on its first call; without numba, return it unchanged."""
    if numba is None:
        return function
    # the wrapper for callers in C is not used here; without it, compiling takes 6 % less
    compiled = numba.njit(no_cfunc_wrapper=True)(function)
    if active():
        compiled._cache = CompileCache(function)
    return compiled


def prepared(function: F, *arguments: object) -> F:
    """Return the machine code of `function` for arguments like these, for a call at every tick.

    numba compares the types of all arguments at each call, which takes longer than most functions
    here. All later arguments must have the same types and memory layout: nothing checks it. The
    examples are not used otherwise. A function that is not compiled is returned as it is.
    """
    if not hasattr(function, "get_overload"):
        return function
    signature = tuple(map(numba.typeof, arguments))
    function.compile(signature)
    return function.get_overload(signature)
