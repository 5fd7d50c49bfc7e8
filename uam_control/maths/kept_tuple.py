"""A tuple of arrays for compiled functions, handed over once; functions called by their address.

numba unwraps every array of an argument at every call: 0.3 us each. A tuple of a hundred arrays
takes longer than what some functions do with it. Here the unwrapped tuple stays in memory, and the
functions are given its address.

A hook is a function of one tuple of arrays with its tuple, or a function of Python without
arguments. A call needs 3 ns, of a function of Python 70 ns more than the function itself.
"""

import ctypes
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from uam_control.maths import compiled

if compiled.numba is not None:
    import numba
    from numba import types
    from numba.core.registry import cpu_target
    from numba.extending import intrinsic

    @intrinsic
    def _load(typing: Any, address: types.Type, like: types.TypeRef) -> tuple:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            of = context.get_value_type(like.instance_type).as_pointer()
            return builder.load(builder.inttoptr(arguments[0], of))

        return like.instance_type(types.intp, like), code


def _image(value: Any) -> tuple[bytes, int]:
    """Return a value as numba has it in memory, and the alignment [bytes]: a struct of C.

    An array is (owner, object, size, itemsize, data, shape, strides); nobody counts references
    here, so it has neither owner nor object. Raises TypeError for what is no array or number.
    """
    if isinstance(value, tuple):
        found, widest = b"", 1
        for image, alignment in map(_image, value):
            found += bytes(-len(found) % alignment) + image
            widest = max(widest, alignment)
        return found + bytes(-len(found) % widest), widest
    if isinstance(value, np.ndarray):
        of = 0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides
        return np.array(of).tobytes(), 8
    if isinstance(value, (bool, np.bool_)):
        return bytes([value]), 1
    if isinstance(value, (int, float, np.int64)):
        return np.array(value).tobytes(), 8
    raise TypeError(f"a tuple in memory has arrays and numbers, not {type(value).__name__}")


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
        target, (image, _) = cpu_target.target_context, _image(values)
        assert len(image) == target.get_abi_sizeof(target.get_value_type(kind))
        self._memory = np.frombuffer(image, dtype=np.uint8).copy()
        self.address, self.read = self._memory.ctypes.data, _reader(kind)


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
        lambda address, a, b, c, d, e: function(read(address), a, b, c, d, e),
    )
    return compiled.borrowing(calls[count])


@cache
def _reader(kind: Any) -> Callable[[int], Any]:
    """Return the function that reads a tuple of the type `kind` at an address."""

    @compiled.inlined
    def read(address: int) -> Any:
        return _load(address, kind)

    return read


if compiled.numba is not None:
    from llvmlite import ir
    from numba import types
    from numba.core import cgutils
    from numba.extending import intrinsic

    @intrinsic
    def call(typing: Any, function: types.Type, data: types.Type) -> tuple:
        """Call the hook `function` with `data`; return what it returns, raise what it raises."""

        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            convention, takes = context.call_conv, (types.intp,)
            of = convention.get_function_type(types.intp, takes).as_pointer()
            at = builder.inttoptr(arguments[0], of)
            status, found = convention.call_function(builder, at, types.intp, takes, arguments[1:])
            with cgutils.if_unlikely(builder, status.is_error):
                convention.return_status_propagate(builder, status)
            return found

        return types.intp(types.intp, types.intp), code

    @intrinsic
    def _call_c(typing: Any, function: types.Type) -> tuple:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            of = ir.FunctionType(ir.IntType(64), []).as_pointer()
            return builder.call(builder.inttoptr(arguments[0], of), [])

        return types.intp(types.intp), code


_IN_C = ctypes.CFUNCTYPE(ctypes.c_int64)
_plain: list[Callable[[], object]] = []  # without numba: the functions by number

if not compiled.active():

    def call(function: int, data: int) -> int:
        """Call the hook `function`; return what it returns."""
        return _plain[function]()


class Hook(NamedTuple):
    """Address of the function, address of its data, and what must exist while it may be called."""

    function: int
    data: int
    kept: object


def compiled_hook(function: Callable[[tuple], int], arrays: tuple) -> Hook:
    """Return the hook of a function under `compiled.borrowing` on `arrays`."""
    if not compiled.active():
        return _plain_hook(lambda: function(arrays))
    kept = KeptTuple(arrays)
    return Hook(_address(function, kept.read), kept.address, kept)


def python_hook(function: Callable[[], int]) -> Hook:
    """Return the hook of a function of Python; it must not raise."""
    if not compiled.active():
        return _plain_hook(function)
    made = _IN_C(function)
    return Hook(_python(), ctypes.cast(made, ctypes.c_void_p).value, made)


def _plain_hook(function: Callable[[], object]) -> Hook:
    _plain.append(function)
    return Hook(len(_plain) - 1, 0, None)


@cache
def _address(function: Callable[[tuple], int], read: Callable[[int], tuple]) -> int:
    """Return the address of the function that reads the tuple of `function` at an address."""
    return compiled.address_of(lambda address: function(read(address)))


@cache
def _python() -> int:
    """Return the address of the function that calls one of C without arguments."""
    return compiled.address_of(lambda address: _call_c(address))


def table(hooks: Sequence[Hook]) -> np.ndarray:
    """Return the hooks as an array (k, 2) for `call`."""
    return np.array([hook[:2] for hook in hooks], dtype=np.int64).reshape(-1, 2)


@compiled.borrowing
def call_all(hooks: np.ndarray) -> None:
    """Call the hooks of a `table` one after another; what they return does not count."""
    for i in range(len(hooks)):
        call(hooks[i, 0], hooks[i, 1])
