"""The way of a tick from the sensors to the setpoint, node by node, from the nodes' tick times.

The times of all nodes are of one clock (CLOCK_MONOTONIC) and have the stamp of their tick. Each
moment between the sensors' publication and the setpoint's belongs to one segment: the wake-up of a
node, a part of its tick, or its publication.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uam_msgs_py.node.tick_times import PARTS

WAKE_UP = "wake-up"
SEGMENTS = (WAKE_UP, *PARTS)
PUBLISH = "publish"
MS = 1e-6  # [ms/ns]
Columns = Mapping[str, np.ndarray]


class NoTicks(ValueError):
    """Tick times that have no tick in common; the text is one line."""


@dataclass(frozen=True)
class TickPath:
    """The ticks that all nodes of `nodes` have measured."""

    nodes: tuple[str, ...]  # the source of the sensors first
    stamps: np.ndarray  # (ticks,) [ns]
    times: np.ndarray  # (ticks, nodes, segments) [ms] of SEGMENTS

    @property
    def totals(self) -> np.ndarray:
        """Return the time of each tick (ticks,) [ms]."""
        return self.times.sum(axis=(1, 2))

    def mean(self, slowest: float = 1.0) -> np.ndarray:
        """Return the mean (nodes, segments) [ms] of this share of the ticks, the slowest ones."""
        count = max(1, round(slowest * len(self.times)))
        chosen = np.argsort(self.totals, kind="stable")[-count:]
        return self.times[chosen].mean(axis=0)


def tick_path(
    nodes: Sequence[str], measured: Mapping[str, Columns], inside: Sequence[str] = ()
) -> TickPath:
    """Return the path along `nodes`; measured: node → see `read_tick_times`. Raises NoTicks.

    inside: nodes in the process of the last one, which pass its tick on to each other. They follow
    it in the path, with their parts of its tick.
    """
    every = (*nodes, *inside)
    missing = [node for node in every if node not in measured or not len(measured[node]["stamp"])]
    if missing:
        raise NoTicks(f"no tick times of {', '.join(missing)}")
    stamps = measured[nodes[0]]["stamp"]
    for node in every[1:]:
        stamps = np.intersect1d(stamps, measured[node]["stamp"])
    if not len(stamps):
        raise NoTicks(f"no tick was measured by all of {', '.join(every)}")
    columns = [_at(stamps, measured[node]) for node in every]
    # a node publishes nothing in a tick that it drops: such ticks have no way
    whole = np.all([one["sending"] > 0 for one in columns[: len(nodes)]], axis=0)
    if not whole.any():
        raise NoTicks("no tick has a result of every node")
    columns = [{name: values[whole] for name, values in one.items()} for one in columns]
    times = np.zeros((int(whole.sum()), len(every), len(SEGMENTS)))
    arrived = columns[0]["woken"]  # the source begins its tick itself
    last = len(nodes) - 1
    for number, one in enumerate(columns[: len(nodes)]):
        inner = columns[len(nodes) :] if number == last else []
        for place, segments in enumerate(_segments(one, arrived, inner), start=number):
            times[:, place] = MS * segments
        arrived = np.maximum(arrived, one["sent"])
    return TickPath(every, stamps[whole], times)


def _at(stamps: np.ndarray, columns: Columns) -> dict[str, np.ndarray]:
    """Return the rows of `stamps`; of a stamp that occurs twice the first."""
    _, first = np.unique(columns["stamp"], return_index=True)
    rows = first[np.isin(columns["stamp"][first], stamps)]
    return {name: values[rows] for name, values in columns.items()}


def _segments(
    node: Columns, arrived: np.ndarray, inner: Sequence[Columns] = ()
) -> Iterator[np.ndarray]:
    """Yield the segments (ticks, segments) [ns] of a node, then those of the nodes `inner`.

    arrived (ticks,): of its last input. A node that is awake before its last input arrives works at
    the other inputs meanwhile: its parts are scaled to the time since the arrival.
    """
    begin = np.maximum(node["woken"], arrived)
    own = np.maximum(0, node["sending"] - begin)
    parts = [_parts(one, node["sending"]) for one in (node, *inner)]
    share = own / np.maximum(1.0, sum(one.sum(axis=0) for one in parts))
    publication = np.maximum(0, node["sent"] - np.maximum(node["sending"], begin))
    for number, one in enumerate(parts):
        one *= share
        wake_up = begin - arrived if number == 0 else np.zeros(len(begin))
        if number == 0:
            one[PARTS.index(PUBLISH)] += publication
        yield np.vstack([wake_up, one]).T


def _parts(node: Columns, sending: np.ndarray) -> np.ndarray:
    """Return the parts (parts, ticks) [ns] of a node's tick until `sending` (ticks,)."""
    whole = np.array([node[part] for part in PARTS], dtype=float)
    until = np.array([node[f"{part} until sending"] for part in PARTS], dtype=float)
    return np.where(node["done"] <= sending, whole, until)


def work(columns: Columns) -> dict[str, float]:
    """Return the mean time of a node's parts per tick [ms], on the path or not; wake-ups excluded.

    `other`: what it does between two ticks, as diagnostics and inputs that complete no tick.
    """
    found = {part: MS * float(columns[part].mean()) for part in PARTS}
    return found | {"other": MS * float(columns["before"].mean())}
