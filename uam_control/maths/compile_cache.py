"""Machine code of the compiled functions on disk, safe for processes that start at the same time.

A process must never load the code of another function or of an older source, even if processes
are killed while they write. numba's own cache does not guarantee this. It numbers its files in an
index that every process reads and writes, so two processes that compile at the same time can use
one number. It also checks only the file of a function, not the files of the functions and
constants that are compiled into it. Here the file name contains a digest of all these inputs.
"""

import hashlib
import pickle
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
from numba import types
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher


def _mangled(record: types.Record) -> tuple[str, tuple[str, ...]]:
    """Return the part of a machine code name that stands for a record type: its layout.

    numba uses a counter of the process instead. Two laws that two processes compile then have one
    name for two layouts. The direct engine loads both and would run one law with the code of the
    other, without an error.
    """
    return "Record", (hashlib.sha256(str(record).encode()).hexdigest()[:16],)


types.Record.mangling_args = property(_mangled)

UNUSABLE = (OSError, EOFError, ImportError, AttributeError, ValueError, pickle.UnpicklingError)


class CompileCache(FunctionCache):
    """The cache of one function; `dispatcher._cache` of numba."""

    def __init__(self, function: Callable):
        given = [name for name, _ in _given(function)]
        if given:
            # The same source with other functions is another function. numba's own name of its
            # machine code ends in a counter of the process that compiled it: two of them, from two
            # processes, may have one name, and a third process that loads both would mix them up.
            digest = hashlib.sha256(repr(given).encode()).hexdigest()[:8]
            function.__qualname__ = f"{function.__qualname__}_{digest}"
        super().__init__(function)
        self._cache_file = _Files(self.cache_path, self._impl.filename_base, function)

    def _index_key(self, signature: Any, codegen: Any) -> Any:
        """Return the key of a signature; numba's contains numbers of the process for what a
        function has from the one that defines it. All of that is in the digest of the sources."""
        if self._py_func.__closure__ is None:
            return super()._index_key(signature, codegen)
        return signature, codegen.magic_tuple()

    @property
    def filled(self) -> bool:
        """Whether the cache contains machine code of the present sources, for any signature."""
        return self._cache_file.filled


class _Files(IndexDataCacheFile):
    """One file for each signature, without an index: <function>.<sources>.<signature>.nbc."""

    def __init__(self, folder: str, base: str, function: Callable):
        super().__init__(folder, base, None)
        self._base, self._function = base, function
        # read the source now: at the first call it may already be edited
        _content(Path(function.__code__.co_filename))

    def _name(self, key: Any) -> str:
        named = [list(_named(kind)) for kind in key[0]]
        signature = hashlib.sha256(repr((numba.__version__, key, named)).encode()).hexdigest()
        return f"{self._base}.{_sources(self._function)}.{signature[:16]}.nbc"

    @property
    def filled(self) -> bool:
        """See `CompileCache.filled`."""
        pattern = f"{self._base}.{_sources(self._function)}.*.nbc"
        return any(Path(self._cache_path).glob(pattern))

    def load(self, key: Any) -> Any:
        """Return the data saved for `key`; None if no usable file exists.

        The file contains pickled types of the arguments. It is of no use if it is damaged, or if
        a class of them has moved to another module since.
        """
        try:
            return self._load_data(self._name(key))
        except UNUSABLE:
            return None

    def save(self, key: Any, data: Any) -> None:
        """Save `data` for `key` and remove the files of older sources."""
        name = self._name(key)
        self._save_data(name, data)
        current = name.rsplit(".", 2)[0]
        for file in Path(self._cache_path).glob(f"{self._base}.*.nbc"):
            if not file.name.startswith(current):
                file.unlink(missing_ok=True)


def _sources(function: Callable) -> str:
    """Return a digest of the source files and constants that are compiled into `function`.

    This file is one of them: it decides how code is named.
    """
    files, constants = {Path(__file__)}, set()
    for part in _parts(function, set()):
        if isinstance(part, Path):
            files.add(part)
        else:
            constants.add(part)
    digest = hashlib.sha256(repr(sorted(constants)).encode())
    for file in sorted(files):
        digest.update(_content(file))
    return digest.hexdigest()[:16]


@cache
def _content(file: Path) -> bytes:
    """Return a digest of a source file as it was when this process imported it."""
    return hashlib.sha256(file.read_bytes()).digest()


def _parts(function: Callable, seen: set[Callable]) -> Iterator[Path | str]:
    """Yield the files of `function` and of the functions it calls, and the constants they use."""
    seen.add(function)
    yield Path(function.__code__.co_filename)
    names = function.__code__.co_names
    for name, inner in _given(function):
        yield name
        if inner is not None and inner not in seen:
            yield from _parts(inner, seen)
    for name in names:
        value = function.__globals__.get(name)
        values = [value]
        if isinstance(value, ModuleType):
            values = [vars(value).get(attribute) for attribute in names]
        for value in values:
            if isinstance(value, Dispatcher):
                if value.py_func not in seen:
                    yield from _parts(value.py_func, seen)
            elif isinstance(value, (int, float, str, tuple, slice)):
                yield f"{name}={value!r}"


def _given(function: Callable) -> Iterator[tuple[str, Callable | None]]:
    """Yield what a function has from the function that defines it: names, and the functions.

    They are compiled functions, and types of numba.
    """
    cells = function.__closure__ or ()
    for name, cell in zip(function.__code__.co_freevars, cells, strict=True):
        value = cell.cell_contents
        if isinstance(value, types.Type):
            yield f"{name}={value}{list(_named(value))}", None
        else:
            inner = value.py_func
            deeper = [one for one, _ in _given(inner)]
            yield f"{name}={inner.__module__}.{inner.__qualname__}{deeper}", inner


def _named(kind: types.Type) -> Iterator[str]:
    """Yield module and fields of each named tuple in a type; numba's text has the name alone."""
    if isinstance(kind, types.TypeRef):
        kind = kind.instance_type
    if isinstance(kind, (types.NamedTuple, types.NamedUniTuple)):
        yield f"{kind.instance_class.__module__}.{kind.instance_class.__qualname__}{kind.fields}"
    for inner in kind.types if isinstance(kind, types.BaseTuple) else ():
        yield from _named(inner)
