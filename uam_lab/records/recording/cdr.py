"""Decodes all serialized messages of one topic into arrays."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uam_msgs_py.messages.layouts import STAMP, Layout, Layouts


@dataclass
class Block:
    """Messages with one layout: stamps (m,) [ns], names, and each field as (m, n) float64.

    order (m,): numbers of the messages within the topic; time_from_start: int64 [ns].
    """

    order: np.ndarray
    stamps: np.ndarray
    names: list[str]
    fields: dict[str, np.ndarray]


def read(type_name: str, messages: Sequence[bytes]) -> list[Block]:
    """Decode all messages of one topic; return one block per layout.

    Raises KeyError for a type without a layout, BadMessage for an invalid message.
    """
    layouts = Layouts(type_name)
    groups: dict[int, tuple[Layout, list[int]]] = {}
    for number, data in enumerate(messages):
        layout = layouts.of(data)
        groups.setdefault(id(layout), (layout, []))[1].append(number)
    return [_block(layout, messages, np.array(numbers)) for layout, numbers in groups.values()]


def _block(layout: Layout, messages: Sequence[bytes], numbers: np.ndarray) -> Block:
    table = np.frombuffer(b"".join([messages[i] for i in numbers]), dtype=np.uint8)
    table = table.reshape(len(numbers), -1)
    fields = {
        name: np.ascontiguousarray(table[:, where]).view("<f8")
        for name, where in layout.fields.items()
    }
    if layout.duration is not None:
        fields["time_from_start"] = _nanoseconds(table[:, layout.duration])
    return Block(numbers, _nanoseconds(table[:, STAMP]), layout.names, fields)


def _nanoseconds(table: np.ndarray) -> np.ndarray:
    """Convert int32 seconds and uint32 nanoseconds, bytes (m, 8), to int64 (m,) [ns]."""
    pairs = np.ascontiguousarray(table).view([("sec", "<i4"), ("nanosec", "<u4")])[:, 0]
    return pairs["sec"].astype(np.int64) * 1_000_000_000 + pairs["nanosec"]
