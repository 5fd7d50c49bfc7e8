"""Compilation of the small fixed-size functions of the control loop.

NumPy needs about a microsecond per call for arrays of three; a control law makes hundreds of such
calls per tick. Compiled code (kept on disk, see `compile_cache`) is ten to a hundred times faster.
Campaigns of thousands of flights and a companion computer need this.

The code stays plain Python. Without numba, or with NUMBA_DISABLE_JIT=1 in the environment (for
debuggers and coverage), every function runs in Python and gives the same numbers up to rounding.
"""

import warnings
from collections.abc import Callable
from typing import TypeVar

try:
    import numba
    from numba.core.errors import NumbaExperimentalFeatureWarning
    from numba.core.options import DefaultOptions

    from uam_control.maths.compile_cache import CompileCache

    # a function that is compiled for a record is used for one that has more fields behind the same
    warnings.filterwarnings(
        "ignore", ".*considered a subtype", category=NumbaExperimentalFeatureWarning
    )
except ImportError:
    numba = DefaultOptions = None

F = TypeVar("F", bound=Callable)


# an option of numba for its own use; without it, no function borrows: see `counts_references`
_COUNTS = "_nrt" if hasattr(DefaultOptions, "_nrt") else ""
_CALLED_BY_ADDRESS: list[object] = []  # owners of the machine code of `address_of`


def active() -> bool:
    """Return whether functions under `jit` are compiled."""
    return numba is not None and not numba.config.DISABLE_JIT


def jit(function: F) -> F:
    """Return `function`, compiled on its first call; without numba, return it unchanged."""
    return _compiled(function, counting=True)


def borrowing(function: F) -> F:
    """Return `function`, compiled as by `jit`, without counting references to arrays.

    For functions that pass many arrays on: counting takes longer than most of what they call. They
    use the arrays of their arguments. They allocate none, and call none that returns one, as
    nobody would free it.
    """
    return _compiled(function, counting=False)


def _compiled(function: F, counting: bool) -> F:
    if numba is None:
        return function
    # the wrapper for callers in C is not used here; without it, compiling takes 6 % less
    compiled = numba.njit(no_cfunc_wrapper=True, **_counting(counting))(function)
    if active():
        compiled._cache = CompileCache(function)
    return compiled


def address_of(function: Callable[[int], int]) -> int:
    """Return the address of a function of one address, compiled as by `borrowing`: for `hooks`.

    It is valid until the process ends.
    """
    made, signature = borrowing(function), (numba.types.intp,)
    made.compile(signature)
    code = made.overloads[signature]
    _CALLED_BY_ADDRESS.append(made)
    return code.library.get_pointer_to_function(code.fndesc.llvm_func_name)


def on_disk(function: Callable) -> bool:
    """Return whether `function` has machine code on disk; an inlined one needs none."""
    return getattr(getattr(function, "_cache", None), "filled", True)


def inlined(function: F) -> F:
    """Return `function`, compiled as a part of each function that calls it, see `borrowing`."""
    return function if numba is None else numba.njit(inline="always", **_counting(False))(function)


def counts_references(function: Callable) -> bool:
    """Return whether a function under `borrowing` may call this one: it is under `jit`."""
    return not active() or bool(getattr(function, "targetoptions", {}).get(_COUNTS))


def _counting(on: bool) -> dict[str, bool]:
    """Return the option of numba for counting references or not; a called function has that of its
    caller otherwise."""
    return {_COUNTS: on} if _COUNTS else {}


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
