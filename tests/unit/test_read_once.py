"""A message that several nodes of one process receive is read once."""

import pytest

from uam_msgs_py.messages.read_once import read_once


def counting():
    calls = []

    @read_once
    def read(data, *further):
        calls.append((data, *further))
        if not data:
            raise ValueError("empty")
        return [data, *further]

    return read, calls


def test_the_same_object_is_read_once_an_equal_one_again():
    read, calls = counting()
    data, equal = bytes([1, 2]), bytes(bytearray([1, 2]))
    assert data is not equal
    assert read(data) is read(data)
    assert len(calls) == 1
    assert read(equal) == read(data) and len(calls) == 3  # each replaced the other


def test_other_arguments_are_another_reading():
    read, calls = counting()
    data = bytes([1])
    assert read(data, "world") == [data, "world"] and read(data, "map") == [data, "map"]
    assert len(calls) == 2


def test_a_refusal_is_repeated():
    read, calls = counting()
    for _ in range(2):
        with pytest.raises(ValueError):
            read(b"")
    assert len(calls) == 2
