"""Machine code of the compiled functions on disk, so that processes that start together and are
killed at any moment never load another function's code, or code of an older source.

numba's own cache is not made for that. It numbers its files through an index that every process
reads and writes back, so two that compile at the same time may use one number; and it knows only
the file of a function, not those of the functions and constants compiled into it. Here a file is
named by everything that its content follows from.
"""

from __future__ import annotations

import hashlib
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
    """What a record type puts into the names of machine code: its layout.

    numba puts a number of the process there. The laws of two nodes, each compiled in its process,
    then have one name for two layouts, and who loads both (the direct engine) runs one law with
    the code of the other, without a word.
    """
    return "Record", (hashlib.sha256(str(record).encode()).hexdigest()[:16],)


types.Record.mangling_args = property(_mangled)


class CompileCache(FunctionCache):
    """The cache of one function; `dispatcher._cache` of numba."""

    def __init__(self, function: Callable):
        super().__init__(function)
        self._cache_file = _Files(self.cache_path, self._impl.filename_base, function)

    @property
    def filled(self) -> bool:
        """Whether it holds machine code of the present sources, for any signature."""
        return self._cache_file.filled


class _Files(IndexDataCacheFile):
    """One file for each signature, without an index: <function>.<sources>.<signature>.nbc."""

    def __init__(self, folder: str, base: str, function: Callable):
        super().__init__(folder, base, None)
        self._base, self._function = base, function
        _content(Path(function.__code__.co_filename))  # now, not at the first call, after an edit

    def _name(self, key: Any) -> str:
        signature = hashlib.sha256(repr((numba.__version__, key)).encode()).hexdigest()
        return f"{self._base}.{_sources(self._function)}.{signature[:16]}.nbc"

    @property
    def filled(self) -> bool:
        """See `CompileCache.filled`."""
        pattern = f"{self._base}.{_sources(self._function)}.*.nbc"
        return any(Path(self._cache_path).glob(pattern))

    def load(self, key: Any) -> Any:
        """Return what was saved for `key`; None if there is nothing, or nothing readable."""
        try:
            return self._load_data(self._name(key))
        except OSError:
            return None

    def save(self, key: Any, data: Any) -> None:
        """Save `data` for `key` and remove what older sources left."""
        name = self._name(key)
        self._save_data(name, data)
        current = name.rsplit(".", 2)[0]
        for file in Path(self._cache_path).glob(f"{self._base}.*.nbc"):
            if not file.name.startswith(current):
                file.unlink(missing_ok=True)


def _sources(function: Callable) -> str:
    """Return a digest of all that is compiled into `function`: files and constants."""
    files, constants = set(), set()
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
    """A digest of a source file as it was when this process had imported it."""
    return hashlib.sha256(file.read_bytes()).digest()


def _parts(function: Callable, seen: set[Callable]) -> Iterator[Path | str]:
    """Yield the files of `function` and of what it calls, and each global constant they name."""
    seen.add(function)
    yield Path(function.__code__.co_filename)
    names = function.__code__.co_names
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
