"""Functions that a compiled loop calls by address: which ones, may change without compiling it.

A hook is a function of one tuple of arrays with its tuple, or a function of Python without
arguments. A call needs 3 ns, of a function of Python 70 ns more than the function itself.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from uam_control.maths import compiled
from uam_control.maths.kept_tuple import KeptTuple

if compiled.numba is not None:
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic

    @intrinsic
    def _call(typing: Any, function: types.Type, data: types.Type) -> tuple:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            word = ir.IntType(64)
            of = ir.FunctionType(word, [word]).as_pointer()
            return builder.call(builder.inttoptr(arguments[0], of), [arguments[1]])

        return types.intp(types.intp, types.intp), code


_IN_C = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)
_plain: list[Callable[[], object]] = []  # without numba: the functions by number

if not compiled.active():

    def _call(function: int, data: int) -> int:
        _plain[function]()
        return 0


class Hook(NamedTuple):
    """Address of the function, address of its data, and what must exist while it may be called."""

    function: int
    data: int
    kept: object


def compiled_hook(function: Callable[[tuple], int], arrays: tuple) -> Hook:
    """Return the hook of a function under `compiled.borrowing`, which returns 0, on `arrays`."""
    if not compiled.active():
        return _plain_hook(lambda: function(arrays))
    kept = KeptTuple(arrays)
    return Hook(_address(function, kept.read), kept.address, kept)


def python_hook(function: Callable[[], object]) -> Hook:
    """Return the hook of a function of Python; it must not raise."""
    if not compiled.active():
        return _plain_hook(function)

    def call(data: int) -> int:
        function()
        return 0

    made = _IN_C(call)
    return Hook(ctypes.cast(made, ctypes.c_void_p).value, 0, made)


def _plain_hook(function: Callable[[], object]) -> Hook:
    _plain.append(function)
    return Hook(len(_plain) - 1, 0, None)


@cache
def _address(function: Callable[[tuple], int], read: Callable[[int], tuple]) -> int:
    """Return the address of the function in C's form that reads its tuple at an address."""
    return compiled.address_in_c(lambda address: function(read(address)))


def table(hooks: Sequence[Hook]) -> np.ndarray:
    """Return the hooks as an array (k, 2) for `call_all`."""
    return np.array([hook[:2] for hook in hooks], dtype=np.int64).reshape(-1, 2)


@compiled.borrowing
def call_all(hooks: np.ndarray) -> None:
    """Call the hooks of a `table` one after another."""
    for i in range(len(hooks)):
        _call(hooks[i, 0], hooks[i, 1])
