"""A tuple of arrays that compiled functions read at an address."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from uam_control.maths import compiled
from uam_control.maths.compiled import borrowing
from uam_control.maths.kept_tuple import KeptTuple


class Pair(NamedTuple):
    """Two arrays and a number."""

    values: np.ndarray
    inner: tuple[np.ndarray, float]


def summing(kept):
    """Return a compiled function that adds everything in the tuple and changes its arrays."""
    read = kept.read

    @borrowing
    def total(address):
        pair = read(address)
        found = pair.inner[1]
        for i in range(len(pair.values)):
            found += pair.values[i] + pair.inner[0][i, 0]
            pair.values[i] = 0.0
        return found

    return total


def test_functions_read_and_write_the_arrays_of_the_tuple():
    values, table = np.arange(3.0), np.arange(6.0).reshape(3, 2)
    kept = KeptTuple(Pair(values, (table, 100.0)))
    total = summing(kept)
    assert total(kept.address) == 100.0 + (0 + 1 + 2) + (0 + 2 + 4)
    assert values.tolist() == [0.0, 0.0, 0.0]
    table[0, 0] = 7.0  # seen without handing it over anew
    assert total(kept.address) == 100.0 + 7 + 2 + 4


def test_two_tuples_of_one_type_are_read_by_one_function():
    one, other = (KeptTuple(Pair(np.full(2, x), (np.zeros((2, 1)), x))) for x in (1.0, 5.0))
    assert one.address != other.address or one.address == 0
    total = summing(other)
    if other.address:  # compiled
        assert one.read is other.read
        assert total(one.address) == 3.0
    assert total(other.address) == 15.0


def test_numbers_and_truths_stand_between_arrays():
    """Records, a strided array, an empty tuple, and numbers of every kind."""
    row = np.zeros(2, dtype=[("n", np.int64), ("x", float)])
    row["n"], row["x"] = (3, 4), (0.5, 0.25)
    truths = False, True, np.int64(2**40), False
    values = True, row, -7, (), np.arange(8.0)[::2], 1.5, np.float64(2.5), truths, True
    kept = KeptTuple(values)
    read = kept.read

    @borrowing
    def found(address, into):
        yes, rows, seven, _, strided, a, b, (no, _, much, _), last = read(address)
        into[0] = rows[1].n + rows[1].x
        into[1] = strided[3] if yes else 0.0
        into[2] = seven * (a + b)
        into[3] = 0.0 if no or not last else much

    into = np.zeros(4)
    found(kept.address, into)
    assert into.tolist() == [4.25, 6.0, -28.0, 2.0**40]


def test_what_is_no_array_and_no_number_is_refused():
    if compiled.active():
        with pytest.raises(TypeError, match="not str"):
            KeptTuple((np.zeros(2), "words"))
