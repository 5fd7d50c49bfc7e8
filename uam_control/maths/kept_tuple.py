"""A tuple of arrays for compiled functions, handed over once and not at each call.

numba unwraps every array of an argument at every call: 0.3 us each. A tuple of a hundred arrays
takes longer than what some functions do with it. Here the unwrapped tuple stays in memory, and the
functions are given its address.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np

from uam_control.maths import compiled

if compiled.numba is not None:
    import numba
    from numba import types
    from numba.core.registry import cpu_target
    from numba.extending import intrinsic

    @intrinsic
    def _store(typing: Any, address: types.Type, value: types.Type) -> tuple:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            of = context.get_value_type(value).as_pointer()
            builder.store(arguments[1], builder.inttoptr(arguments[0], of))
            return context.get_dummy_value()

        return types.void(types.intp, value), code

    @intrinsic
    def _load(typing: Any, address: types.Type, like: types.TypeRef) -> tuple:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            of = context.get_value_type(like.instance_type).as_pointer()
            return builder.load(builder.inttoptr(arguments[0], of))

        return like.instance_type(types.intp, like), code


@compiled.borrowing
def _keep(address: int, value: Any) -> None:
    _store(address, value)


class KeptTuple:
    """A tuple in memory, at `address`; `read`: the function that returns it from there.

    `read` is for functions under `compiled.borrowing` that run in this process while the object
    exists: the memory has no reference to the arrays. Two tuples of one type have the same `read`.
    """

    def __init__(self, values: tuple) -> None:
        self._values = values
        if not compiled.active():
            self.address, self.read = 0, lambda _: values
            return
        kind = numba.typeof(values)
        target = cpu_target.target_context
        size = target.get_abi_sizeof(target.get_value_type(kind))
        self._memory = np.zeros(size, dtype=np.uint8)
        self.address, self.read = self._memory.ctypes.data, _reader(kind)
        _keep(self.address, values)


def bound(function: Callable, values: tuple, *arguments: object) -> Callable:
    """Return `function` with `values` as its first argument, which is handed over once.

    function: under `compiled.jit` or `compiled.borrowing`; later arguments must have the types of
    these examples, see `compiled.prepared`.
    """
    kept = KeptTuple(values)
    call = calling(function, kept.read, len(arguments))
    call = partial(compiled.prepared(call, kept.address, *arguments), kept.address)
    call.kept = kept  # as long as somebody may call it
    return call


@cache
def calling(function: Callable, read: Callable[[int], Any], count: int) -> Callable:
    """Return the function that reads the first argument of `function` at an address; count: of its
    further ones."""
    calls = (
        lambda address: function(read(address)),
        lambda address, a: function(read(address), a),
        lambda address, a, b: function(read(address), a, b),
        lambda address, a, b, c: function(read(address), a, b, c),
        lambda address, a, b, c, d: function(read(address), a, b, c, d),
    )
    return compiled.borrowing(calls[count])


@cache
def _reader(kind: Any) -> Callable[[int], Any]:
    """Return the function that reads a tuple of the type `kind` at an address."""

    @compiled.inlined
    def read(address: int) -> Any:
        return _load(address, kind)

    return read
